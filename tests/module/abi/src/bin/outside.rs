// SPDX-License-Identifier: GPL-2.0-or-later
//! Opens the module in a process without HAL, and has it described: `outside [COORDINATES [SPARM]]`.

use abi_tests::outside::Library;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [coordinates, sparm] = [0, 1].map(|n| arguments.get(n).map(String::as_str));
    let library = match Library::open() {
        Ok(library) => library,
        Err(error) => {
            eprintln!("outside: {error}");
            return ExitCode::FAILURE;
        }
    };
    let Ok(mut described) = library.describe(coordinates, sparm) else { return ExitCode::FAILURE };
    let [types, joints] = described.counts();
    let parameters = described.parameters().len();
    // Of no machine in force: refused, and without HAL.
    let refused = described.inverse(0, &[0.0; 9]);
    println!("{parameters} parameters, {types} types, {joints} joints, inverse: {refused:?}");
    ExitCode::SUCCESS
}
