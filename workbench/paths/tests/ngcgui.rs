// SPDX-License-Identifier: GPL-2.0-or-later
//! The pages of NGCGUI, read by the parser with which AXIS displays them.

use crate::curve::ZERO;
use crate::typical::{TYPICAL, prepared, read, subroutines};
use program::motion::MoveKind;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Folder of the parser in LinuxCNC's packages.
const TCL: &str = "/usr/lib/tcltk/linuxcnc";

/// Prints what the parser finds in files: their text, and name, default and text of every argument. The
/// parser's own procedures require the array name `ay`.
const PAGES: &str = "
source [lindex $argv 0]/ngcgui.tcl
set ::ngc(any,app) pages
array set ay {any,width,varname 0 1,retainvalues 0}
foreach file [lrange $argv 1 end] {
    if {![::ngcgui::parse_ngc 1 ay $file]} {
        puts \"$file\\trefused\\t$ay(1,parse,msg)\"
        continue
    }
    puts \"$file\\tinfo\\t$ay(1,info)\"
    for {set i 1} {$i <= $ay(1,argct)} {incr i} {
        set n [format %02d $i]
        foreach what {dvalue comment} {
            if {![info exists ay(1,arg,$what,$n)]} { set ay(1,arg,$what,$n) {} }
        }
        puts \"$file\\t$ay(1,arg,name,$n)\\t$ay(1,arg,dvalue,$n)\\t$ay(1,arg,comment,$n)\"
    }
}
";

/// One page: its text, and name, default and text of every argument.
#[derive(Default)]
struct Page {
    info: String,
    arguments: Vec<[String; 3]>,
}

fn pages() -> BTreeMap<String, Page> {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("pages.tcl");
    fs::write(&script, PAGES).unwrap();
    let files = fs::read_dir(subroutines()).unwrap().map(|entry| entry.unwrap().path());
    let is_page = |file: &Path| fs::read_to_string(file).unwrap().contains("(info:");
    let files: Vec<_> = files.filter(|file| is_page(file)).collect();
    let out = Command::new("tclsh").arg(&script).arg(TCL).args(&files).output().unwrap();
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.success(), "{said}{}", String::from_utf8_lossy(&out.stderr));
    let mut pages = BTreeMap::<String, Page>::new();
    for line in said.lines().filter(|line| line.contains('\t')) {
        let words: Vec<&str> = line.split('\t').collect();
        let name = Path::new(words[0]).file_stem().unwrap().to_str().unwrap().to_string();
        let page = pages.entry(name).or_default();
        match words[1..] {
            ["info", info] => page.info = info.into(),
            [name, default, text] => {
                page.arguments.push([name, default, text].map(String::from));
            }
            _ => panic!("{line}"),
        }
    }
    assert_eq!(pages.len(), files.len());
    pages
}

#[test]
fn every_page_says_what_it_does_and_every_argument_has_a_default_and_a_text_of_its_own() {
    for (name, page) in pages() {
        assert!(!page.info.is_empty() && !page.info.starts_with("Current subfile"), "{name}");
        let call = format!("o<{name}> call");
        let typical = TYPICAL.iter().find(|typical| typical.call.starts_with(&call)).unwrap();
        assert_eq!(page.arguments.len(), typical.call.matches('[').count(), "{name}");
        // AXIS displays the texts, not the names.
        let texts: BTreeSet<&String> = page.arguments.iter().map(|[_, _, text]| text).collect();
        assert_eq!(texts.len(), page.arguments.len(), "{name}: {texts:?}");
        for [argument, default, text] in &page.arguments {
            assert!(default.parse::<f64>().is_ok(), "{name} {argument}: {default:?}");
            assert!(text.len() > 3, "{name} {argument}: {text:?}");
        }
    }
}

#[test]
fn a_page_left_as_it_opens_makes_a_path() {
    let (_folder, config) = prepared("pyramid", "");
    let preamble = fs::read_to_string(subroutines().join("pkm_preamble.ngc")).unwrap();
    for (name, page) in pages() {
        let defaults: String =
            page.arguments.iter().map(|[_, default, _]| format!(" [{default}]")).collect();
        let moves = read(
            &config,
            &format!("{preamble}\nG10 L2 P1 Z{ZERO}\no<{name}> call{defaults}\nM2\n"),
        );
        assert!(moves.iter().any(|step| step.kind == MoveKind::Feed), "{name}: {moves:?}");
        assert!(moves.iter().all(|step| step.end.iter().all(|x| x.is_finite())), "{name}");
    }
}
