// SPDX-License-Identifier: GPL-2.0-or-later
//! Pages of a browser about one run or one program.

use crate::draw::plot::Plot;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "body { font-family: sans-serif; max-width: 62em; margin: 2em auto }
td, th { text-align: left; padding: 0.2em 1em 0.2em 0; vertical-align: top }
.bad { font-weight: bold }
img { max-width: 100% }
";

/// A page with its title as heading.
pub fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (title) }
                (body)
            }
        }
    };
    page.into_string()
}

/// One page without other files: a text, and plots under their captions.
pub fn single_page(title: &str, text: &str, plots: &[Plot]) -> String {
    let body = html! {
        pre { (text) }
        @for plot in plots {
            h2 { (plot.caption) }
            (PreEscaped(&plot.svg))
        }
    };
    page(title, &body)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_messages_cannot_become_markup() {
        let page = single_page("<b>", "a < b & c > d", &[]);
        assert!(page.contains("a &lt; b &amp; c &gt; d") && !page.contains("<b>"), "{page}");
    }
}
