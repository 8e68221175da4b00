// SPDX-License-Identifier: GPL-2.0-or-later
//! Elements of an XML file.

use kinematics::Vector3;
use xml::common::XmlVersion;
use xml::writer::{EmitterConfig, EventWriter, XmlEvent};

/// An element, with children or a text.
pub struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    text: String,
    children: Vec<Element>,
}

impl Element {
    pub fn new(name: &'static str) -> Self {
        Self { name, attributes: vec![], text: String::new(), children: vec![] }
    }

    /// Adds an attribute.
    pub fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.attributes.push((name, value.to_string()));
        self
    }

    /// Sets the text.
    pub fn text(mut self, text: impl ToString) -> Self {
        self.text = text.to_string();
        self
    }

    /// Adds an element.
    pub fn child(mut self, child: Element) -> Self {
        self.children.push(child);
        self
    }

    /// Adds elements.
    pub fn children(mut self, children: impl IntoIterator<Item = Element>) -> Self {
        self.children.extend(children);
        self
    }

    /// Adds an element.
    pub fn push(&mut self, child: Element) {
        self.children.push(child);
    }

    /// Returns the file, with comments after its first line.
    pub fn file(&self, comment: &str) -> String {
        let config = EmitterConfig::new().perform_indent(true);
        let mut writer = EventWriter::new_with_config(vec![], config);
        let encoding = Some("UTF-8");
        let first =
            XmlEvent::StartDocument { version: XmlVersion::Version10, encoding, standalone: None };
        let head = [first, XmlEvent::comment(comment)];
        let written = head.into_iter().try_for_each(|event| writer.write(event));
        let written = written.and_then(|()| self.write(&mut writer));
        written.expect("well-formed XML in memory");
        String::from_utf8(writer.into_inner()).expect("text") + "\n"
    }

    fn write(&self, writer: &mut EventWriter<Vec<u8>>) -> xml::writer::Result<()> {
        let start = XmlEvent::start_element(self.name);
        let start =
            self.attributes.iter().fold(start, |start, (name, value)| start.attr(*name, value));
        writer.write(start)?;
        if !self.text.is_empty() {
            writer.write(XmlEvent::characters(&self.text))?;
        }
        self.children.iter().try_for_each(|child| child.write(writer))?;
        writer.write(XmlEvent::end_element())
    }
}

/// Lengths, angles, masses and inertias below this are rounding.
const LEAST: f64 = 1e-15;

/// Returns numbers with all their digits, separated by spaces.
pub fn numbers(values: &[f64]) -> String {
    let rounded = |value: &f64| if value.abs() < LEAST { 0.0 } else { *value };
    values.iter().map(|value| rounded(value).to_string()).collect::<Vec<_>>().join(" ")
}

/// Returns the three numbers of a vector.
pub fn vector(value: &Vector3<f64>) -> String {
    numbers(value.as_slice())
}
