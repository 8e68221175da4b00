// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands in the documentation. `new` and the live tests run those of docs/guide/getting-started.md.

use crate::commands::Bench;
use std::fs;
use std::path::{Path, PathBuf};

/// Lists all pages for users.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut pages = vec![root.join("README.md"), root.join("tests/live/README.md")];
    for folder in ["docs/guide", "docs/reference", "docs/studies", "docs/develop"] {
        pages.extend(fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path()));
    }
    for folder in fs::read_dir(root.join("configs")).unwrap() {
        pages.push(folder.unwrap().path().join("README.md"));
    }
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    pages
}

/// Returns the commands of a page, in blocks and in lines of text, without comments in a block.
fn commands(page: &Path) -> (Vec<String>, Vec<String>) {
    let text = fs::read_to_string(page).unwrap().replace("\\\n        ", "");
    let (mut blocks, mut inline) = (vec![], vec![]);
    for line in text.lines() {
        match line.strip_prefix("    pkm ").or(line.strip_prefix("$ pkm ")) {
            Some(block) => blocks.extend(block.split("  ").next().map(String::from)),
            None => inline.extend(
                line.split('`')
                    .skip(1)
                    .step_by(2)
                    .filter_map(|code| code.strip_prefix("pkm "))
                    .map(String::from),
            ),
        }
    }
    let alone = |command: String| {
        let end = command.find([';', '|', '<', '>', '#']).unwrap_or(command.len());
        command[..end].trim().replace('"', "")
    };
    (blocks.into_iter().map(alone).collect(), inline.into_iter().map(alone).collect())
}

#[test]
fn every_command_with_a_machine_has_a_subcommand_and_options_that_exist() {
    let bench = Bench::new();
    let mut count = 0;
    for page in pages() {
        let (blocks, inline) = commands(&page);
        for command in blocks.into_iter().chain(inline) {
            // Without names of Python's commands, and placeholders.
            let is_whole = command.contains(".ini")
                && !command.contains(['…', '['])
                && !command.contains("...");
            if !is_whole || command.starts_with("design") || command.starts_with("compare") {
                continue;
            }
            let answer = bench.answer(&command, "");
            assert!(
                !answer.contains("try '--help'"),
                "{}: pkm {command}: {answer}",
                page.display()
            );
            count += 1;
        }
    }
    assert!(count > 40, "{count} commands: the pages are not found");
}

#[test]
fn commands_of_the_guide_run() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide");
    let mut count = 0;
    for page in ["frames.md", "homing.md", "panel.md"] {
        for command in commands(&guide.join(page)).0 {
            // The pose belongs to a hexapod with all six coordinates.
            let command =
                command.replace("MACHINE", "linear-delta").replace("X20 Z300 A5", "X20 Z80");
            let answer = Bench::new().answer(&command, "");
            assert!(answer.ends_with("exit 0\n"), "{page}: pkm {command}: {answer}");
            count += 1;
        }
    }
    assert!(count > 5, "{count} commands: the blocks are not found");
}
