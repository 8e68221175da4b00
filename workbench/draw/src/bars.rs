// SPDX-License-Identifier: GPL-2.0-or-later
//! Bars in groups.

use crate::plot::DrawError;
use crate::sheet::{Frame, drawn, tick};
use crate::style::{FONT, NAME, PALE, SMALL, TITLE, area_color, letters_at};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

/// A bar.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// Number of its joint or leg.
    pub number: usize,
    pub value: f64,
    /// Half width of the interval around the value; 0 for none.
    pub half: f64,
}

impl Bar {
    /// Returns the end of the bar or of its interval, whichever is farther from 0.
    fn end(&self) -> f64 {
        self.value + self.half * self.value.signum()
    }
}

/// Bars next to each other, with a name.
#[derive(Clone, Debug)]
pub struct Group {
    pub name: String,
    pub bars: Vec<Bar>,
}

/// Draws bars in groups, each bar with its number and its interval.
pub(super) fn bars(frame: &Frame, groups: &[Group]) -> Result<String, DrawError> {
    let ends = groups.iter().flat_map(|group| group.bars.iter().map(Bar::end));
    let most = ends.fold(0.0, |most: f64, end| most.max(end.abs())).max(f64::MIN_POSITIVE);
    let count = groups.iter().map(|group| group.bars.len()).max().unwrap_or(1);
    drawn(|root| {
        let width = groups.len() as f64;
        let mut chart = ChartBuilder::on(root)
            .caption(frame.title, (FONT, TITLE))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(96)
            .build_cartesian_2d(0.0..width, -1.15 * most..1.3 * most)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(0)
            .x_desc(frame.x)
            .y_desc(frame.y)
            .y_label_formatter(&tick)
            .label_style((FONT, SMALL))
            .axis_desc_style((FONT, NAME))
            .light_line_style(WHITE)
            .draw()?;
        let number = letters_at(SMALL, HPos::Center, VPos::Center);
        for (g, Group { name, bars }) in groups.iter().enumerate() {
            let left = |j: usize| g as f64 + 0.1 + 0.8 * j as f64 / count as f64;
            for (j, bar) in bars.iter().enumerate() {
                let middle = left(j) + 0.32 / count as f64;
                let corners = [(left(j), 0.0), (left(j) + 0.64 / count as f64, bar.value)];
                let filled = Rectangle::new(corners, area_color(0).filled());
                let outline = Rectangle::new(corners, BLACK.stroke_width(1));
                chart.draw_series([filled, outline])?;
                if bar.half > 0.0 {
                    let ends = [bar.value - bar.half, bar.value + bar.half];
                    chart.draw_series([PathElement::new(ends.map(|end| (middle, end)), BLACK)])?;
                }
                let at = (middle, bar.end() + most * 0.04 * bar.value.signum());
                chart.draw_series([Text::new(bar.number.to_string(), at, number.clone())])?;
            }
            let head = letters_at(TITLE, HPos::Center, VPos::Top);
            chart.draw_series([Text::new(name.clone(), (g as f64 + 0.5, 1.28 * most), head)])?;
            if g > 0 {
                let edge = [(g as f64, -1.15 * most), (g as f64, 1.3 * most)];
                chart.draw_series([PathElement::new(edge, PALE.stroke_width(1))])?;
            }
        }
        let zero = [(0.0, 0.0), (width, 0.0)];
        chart.draw_series([PathElement::new(zero, BLACK.stroke_width(1))])?;
        Ok(())
    })
}
