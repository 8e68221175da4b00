// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands in the documentation, and the documentation as `pkm help` shows it. `new` and the live tests run the
//! commands of docs/guide/getting-started.md.

use crate::commands::Bench;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PKM: &str = env!("CARGO_BIN_EXE_pkm");

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

/// Runs a program with these words and no terminal.
fn ran(program: &Path, words: &[&str]) -> Output {
    Command::new(program).args(words).output().unwrap()
}

/// Returns the text of every file that users get: what is installed, and the sources of messages, without comments
/// for developers.
fn shown_texts() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let listed = Command::new("git")
        .args([
            "ls-files",
            "command/src",
            "kinsmodule",
            "workbench",
            "hal",
            "viewer",
            "subroutines",
            "configs",
        ])
        .args(["python/pkmkins", "docs/reference/pkmkins.9"])
        .current_dir(&root)
        .output()
        .unwrap();
    let mut texts = vec![];
    for name in String::from_utf8(listed.stdout).unwrap().lines() {
        let is_tool = name.contains("/tests/") || name.starts_with("kinsmodule/header");
        let Ok(text) = fs::read_to_string(root.join(name)) else { continue };
        if is_tool || name.ends_with(".md") {
            continue;
        }
        // The help of subcommands is written as their documentation.
        let is_help = name.starts_with("command/src/");
        let is_shown = |line: &&str| {
            let line = line.trim_start();
            !name.ends_with(".rs") || !line.starts_with("//") || is_help && line.starts_with("/// ")
        };
        texts.push((name.into(), text.lines().filter(is_shown).collect::<Vec<_>>().join("\n")));
    }
    texts
}

#[test]
fn every_page_that_a_text_names_is_shown_by_pkm_help() {
    let mut found = std::collections::BTreeSet::new();
    for (name, text) in shown_texts() {
        for folder in ["docs/guide/", "docs/reference/", "docs/studies/"] {
            let is_tool = name == "kinsmodule/keys/src/lib.rs";
            assert!(
                is_tool || !text.contains(folder),
                "{name}: name pages as pkm help FOLDER/PAGE"
            );
        }
        let words = text.replace("\\-", "-");
        for part in words.split("pkm help ").skip(1) {
            let end = part.find(|c: char| !c.is_ascii_lowercase() && !"/-".contains(c));
            found.insert(part[..end.unwrap_or(part.len())].to_owned());
        }
        // The table of further reading names pages alone.
        if name == "command/src/examples.rs" {
            found.extend(
                text.split('"')
                    .skip(1)
                    .step_by(2)
                    .filter(|w| w.contains('/') && !w.contains([' ', '.', '{']))
                    .map(String::from),
            );
        }
    }
    assert!(found.len() > 20, "{found:?}: the texts are not found");
    for page in found.iter().filter(|page| !page.is_empty()) {
        let shown = ran(Path::new(PKM), &["help", page]);
        assert!(
            shown.status.success(),
            "pkm help {page}: {}",
            String::from_utf8_lossy(&shown.stderr)
        );
    }
}

#[test]
fn help_finds_every_page_by_its_name_and_prints_its_text_and_its_place() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").canonicalize().unwrap();
    let mut names = std::collections::BTreeSet::new();
    for folder in ["guide", "reference", "studies"] {
        for entry in fs::read_dir(docs.join(folder)).unwrap() {
            let file = entry.unwrap().path();
            if file.extension().is_none_or(|ending| ending != "md") {
                continue;
            }
            let stem = file.file_stem().unwrap().to_str().unwrap();
            let name = match stem {
                "README" => folder.to_owned(),
                _ => format!("{folder}/{stem}"),
            };
            assert!(stem == "README" || names.insert(stem.to_owned()), "{stem}: two pages");
            let shown = ran(Path::new(PKM), &["help", &name]);
            assert_eq!(shown.stdout, fs::read(&file).unwrap(), "{name}");
            assert_eq!(String::from_utf8_lossy(&shown.stderr), format!("{}\n", file.display()));
        }
    }
    // By the name alone, and as the sources name it; a subcommand goes first.
    for words in ["migrating", "docs/guide/migrating.md"] {
        let shown = ran(Path::new(PKM), &["help", words]);
        assert_eq!(shown.stdout, fs::read(docs.join("guide/migrating.md")).unwrap(), "{words}");
    }
    let frames = ran(Path::new(PKM), &["help", "frames"]);
    assert!(String::from_utf8_lossy(&frames.stdout).contains("Usage: pkm frames"), "{frames:?}");
    let none = ran(Path::new(PKM), &["help", "guide/nothing"]);
    let reported = String::from_utf8_lossy(&none.stderr);
    assert!(none.status.code() == Some(2) && reported.contains("pkm help guide"), "{reported}");
}

#[test]
fn an_installed_pkm_shows_the_pages_beside_it_and_reports_where_they_are_missing() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path().canonicalize().unwrap();
    let pkm = place.join("bin/pkm");
    fs::create_dir(place.join("bin")).unwrap();
    fs::copy(PKM, &pkm).unwrap();
    let missing = ran(&pkm, &["help", "guide"]);
    let reported = String::from_utf8_lossy(&missing.stderr);
    let docs = place.join("share/doc/pkm/docs");
    assert!(missing.status.code() == Some(2) && missing.stdout.is_empty(), "{missing:?}");
    assert!(reported.starts_with(&format!("pkm: {} is missing", docs.display())), "{reported}");
    assert!(reported.contains("install the package pkm again"), "{reported}");
    fs::create_dir_all(docs.join("guide")).unwrap();
    fs::write(docs.join("guide/README.md"), "# Guide\n").unwrap();
    let html = place.join("share/doc/pkm/html/docs/guide/README.html");
    fs::create_dir_all(html.parent().unwrap()).unwrap();
    fs::write(&html, "").unwrap();
    let shown = ran(&pkm, &["help", "guide"]);
    assert_eq!(shown.stdout, b"# Guide\n");
    let page = docs.join("guide/README.md");
    let places = format!("{}\n{}\n", page.display(), html.display());
    assert_eq!(String::from_utf8_lossy(&shown.stderr), places);
}

/// A heading of a page with what a translation keeps below it.
#[derive(Debug, PartialEq)]
struct Section {
    level: usize,
    /// Lines of code blocks.
    blocks: Vec<String>,
    /// Texts in code style, sorted: a translated sentence may have another order.
    code: Vec<String>,
    /// Number of cells in each row of its tables.
    tables: Vec<usize>,
    /// Number of items in its lists.
    items: usize,
}

/// Returns the sections of a page.
fn sections(page: &str) -> Vec<Section> {
    let mut all: Vec<Section> = vec![];
    let mut is_fenced = false;
    for line in page.lines() {
        is_fenced ^= line.starts_with("```");
        let is_code = is_fenced || line.starts_with("    ") || line.starts_with("```");
        let level = line.chars().take_while(|c| *c == '#').count();
        if !is_code && level > 0 {
            let (blocks, code, tables) = (vec![], vec![], vec![]);
            all.push(Section { level, blocks, code, tables, items: 0 });
        }
        let Some(section) = all.last_mut() else { continue };
        if is_code {
            section.blocks.push(line.into());
            continue;
        }
        section.code.extend(line.split('`').skip(1).step_by(2).map(String::from));
        if line.starts_with('|') {
            section.tables.push(line.matches('|').count());
        }
        section.items += usize::from(line.starts_with("- "));
    }
    all.iter_mut().for_each(|section| section.code.sort());
    all
}

#[test]
fn translations_have_the_headings_code_and_tables_of_the_original() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for (original, translation, own_items) in [
        // The translation of the README also lists the one of the papers.
        ("README.md", "docs/uk/README.md", 1),
        ("docs/studies/papers.md", "docs/uk/papers.md", 0),
    ] {
        let [english, ukrainian] = [original, translation]
            .map(|page| sections(&fs::read_to_string(root.join(page)).unwrap()));
        assert_eq!(english.len(), ukrainian.len(), "{translation}: headings");
        let count = english.len();
        for (k, (mut english, ukrainian)) in english.into_iter().zip(ukrainian).enumerate() {
            english.items += if k + 1 == count { own_items } else { 0 };
            assert_eq!(ukrainian, english, "{translation}: heading {} from the top", k + 1);
        }
    }
}
