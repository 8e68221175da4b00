// SPDX-License-Identifier: GPL-2.0-or-later
//! The page: one file that needs no network, with its code, its kinematics and its data.

use crate::data::Data;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

/// The page without code and data, and its style and code, built from the folder `page` (`cargo xtask page`).
const FRAME: &str = include_str!("../../../page/src/page.html");
const STYLE: &str = include_str!("../../../page/built/page.css");
const CODE: &str = include_str!("../../../page/built/page.js");
const KINEMATICS: &[u8] = include_bytes!("../../../page/built/kinematics.wasm");

pub fn page(data: &Data) -> String {
    let parts = [
        ("<!--style-->", format!("<style>{STYLE}</style>")),
        ("<!--kinematics-->", packed("kinematics", KINEMATICS)),
        ("<!--data-->", packed("data", data.json().as_bytes())),
        ("<!--code-->", format!("<script type=\"module\">{CODE}</script>")),
    ];
    let mut rest = FRAME;
    let mut page = String::new();
    for (mark, part) in parts {
        let (before, after) = rest.split_once(mark).expect("the frame has a mark for every part");
        page.push_str(before);
        page.push_str(&part);
        rest = after;
    }
    page + rest
}

/// Compresses bytes, as text that no browser executes.
fn packed(id: &str, bytes: &[u8]) -> String {
    let mut gzip = GzEncoder::new(vec![], Compression::best());
    gzip.write_all(bytes).expect("memory takes what is written");
    let text = BASE64_STANDARD.encode(gzip.finish().expect("memory takes what is written"));
    format!("<script type=\"application/gzip\" id=\"{id}\">{text}</script>")
}
