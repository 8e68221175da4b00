// SPDX-License-Identifier: GPL-2.0-or-later
//! The compiled half of the Python package `pkmkins`: the core and the studies of `pkm` on arrays of numpy.
//!
//! `machine` is the class for Python; its methods call `kinematics` and `studies`;
//! `program` judges programs; `sections` writes the text of a machine without a file. `arrays` converts arrays,
//! `batch` computes row by row on all cores, `refusal` converts errors to exceptions. Signatures, shapes and units are
//! documented in `pkmkins/_core.pyi`.

mod arrays;
mod batch;
mod kinematics;
mod machine;
mod program;
mod refusal;
mod sections;
mod studies;

/// Functions and classes that `pkmkins/__init__.py` exports.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::batch::Answer;
    #[pymodule_export]
    use crate::kinematics::Margins;
    #[pymodule_export]
    use crate::machine::Machine;
    #[pymodule_export]
    use crate::program::preflight;
    #[pymodule_export]
    use crate::refusal::{CommandFailed, MachineError, Refused, cause};
    #[pymodule_export]
    use crate::studies::{Sensitivity, Stiffness, Workspace};

    /// Version of the package and of the core in it.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
