// SPDX-License-Identifier: GPL-2.0-or-later
//! Mistakes in tables with two runs, each named by its line, column and kind.

use crate::shop::{Shop, dial};
use test_support::shipped::cases;

pub(crate) const READING: usize = 9;
pub(crate) const AGAIN: usize = 10;

/// The readings of a table, and the lines around them.
#[derive(Clone)]
pub(crate) struct Table(Vec<Vec<String>>);

impl Table {
    pub(crate) fn new(text: &str) -> Self {
        Self(text.lines().map(|line| line.split(',').map(Into::into).collect()).collect())
    }

    pub(crate) fn text(&self) -> String {
        self.0.iter().map(|cells| cells.join(",") + "\n").collect()
    }

    /// Returns the index of the first row; its line is one more.
    fn first(&self) -> usize {
        self.0.iter().position(|cells| cells[0] == "1").unwrap()
    }

    /// Returns the line of a row, both from 1.
    pub(crate) fn line(&self, row: usize) -> usize {
        self.first() + row
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.0[self.line(row) - 1][column].parse().unwrap()
    }

    /// Changes readings of some rows.
    pub(crate) fn with(
        &self,
        rows: impl IntoIterator<Item = usize>,
        column: usize,
        new: impl Fn(f64) -> f64,
    ) -> Self {
        let mut table = self.clone();
        for row in rows {
            let value = new(self.value(row, column));
            table.0[self.line(row) - 1][column] = format!("{value:.4}");
        }
        table
    }

    /// Gives rows the readings of others.
    fn from(&self, rows: &[usize], others: &[usize], column: usize) -> Self {
        let mut table = self.clone();
        for (row, other) in rows.iter().zip(others) {
            table.0[self.line(*row) - 1][column] = self.0[self.line(*other) - 1][column].clone();
        }
        table
    }

    pub(crate) fn exchanged(&self, a: usize, b: usize, column: usize) -> Self {
        self.from(&[a, b], &[b, a], column)
    }

    /// Enters the readings of some rows a row too low, the last one on top.
    pub(crate) fn lower(&self, first: usize, last: usize, column: usize) -> Self {
        let rows: Vec<usize> = (first..=last).collect();
        let mut others = rows.clone();
        others.rotate_right(1);
        self.from(&rows, &others, column)
    }

    /// Returns the two rows with the most different readings, in their order.
    pub(crate) fn extremes(&self, rows: usize) -> (usize, usize) {
        let mut order: Vec<usize> = (1..=rows).collect();
        order.sort_by(|a, b| self.value(*a, READING).total_cmp(&self.value(*b, READING)));
        let (a, b) = (order[0], order[rows - 1]);
        (a.min(b), a.max(b))
    }
}

pub(crate) fn bar() -> String {
    "unit = \"mm\"\ngauge = \"bar\"\nreading = \"mm\"\ndeviation = 0.002\nrange = [1, 200]\nexpected = 150\nzero = 0.01\n\
     tool = [0, 0, 60]\nclearance = 5\nfeed = 300\n[[object]]\nname = \"socket\"\nplace = [0, 0, 450]\ncone = 30\n"
        .into()
}

/// Returns shops with a dial or a bar, and the noise of each gauge.
pub(crate) fn shops() -> [(Shop, f64); 4] {
    [
        (Shop::new("lab-hexapod", &dial([0.0, 0.0, 580.0], 120.0, false, "mm"), 0.1), 2.0),
        (Shop::new("linear-delta", &dial([0.0, 0.0, 10.0], 60.0, true, "mm"), 0.1), 2.0),
        (Shop::new("rotary-delta", &dial([0.0, 0.0, -15.0], 4.0, false, "inch"), 0.004), 2.0),
        (Shop::new("lab-hexapod", &bar(), 0.1), 0.002),
    ]
}

/// A mistake: its table and the message, which begins with a line.
type Case = (Table, usize, String);

/// Returns mistakes that every gauge allows.
fn in_any_table(good: &Table, unit: &str) -> Vec<Case> {
    let (low, high) = good.extremes(30);
    let line = |row: usize| good.line(row);
    let exchange = |columns: &str| {
        format!(
            "the readings of lines {} and {}{columns} would fit if exchanged",
            line(low),
            line(high)
        )
    };
    let own = |unit: &str| match unit {
        "um" => 1e-3,
        "mm" => 1.0,
        "thou" => 0.0254,
        _ => 25.4,
    };
    let to = |other: &str| own(unit) / own(other);
    let is_um = unit == "um";
    let (small, smaller) = if is_um { ("thou", "mm") } else { ("inch", "inch") };
    let odd = |value: f64| value * 1.2;
    vec![
        (good.exchanged(low, high, AGAIN), line(low), exchange(" in column again")),
        (good.exchanged(low, high, READING), line(low), exchange(" in column reading")),
        (good.exchanged(low, high, READING).exchanged(low, high, AGAIN), line(low), exchange("")),
        (
            good.with([7], AGAIN, |x| x * to(smaller)),
            line(7),
            "of pose 7 in column again does not fit the other run, but ".into(),
        ),
        (good.with([19], READING, |x| x * to(small)), line(19), format!(" {small} would: enter ")),
        (
            good.with(1..=30, AGAIN, |x| x * to(small)),
            line(1),
            format!("30 of 30 readings in column again fit the other run if they are in {small}"),
        ),
        (
            good.with(1..=30, READING, |x| x * to(smaller)),
            line(1),
            format!(
                "30 of 30 readings in column reading fit the other run if they are in {smaller}"
            ),
        ),
        (
            good.with(11..=17, AGAIN, |x| x * to(small)),
            line(11),
            format!("7 of 30 readings in column again fit the other run if they are in {small}"),
        ),
        (
            good.with([23], AGAIN, odd),
            line(23),
            format!("the readings of pose 23, {} and ", good.value(23, READING)),
        ),
        (good.with([23], READING, odd), line(23), "in column reading is wrong".into()),
    ]
}

#[test]
fn every_mistake_in_one_of_two_runs_or_both_is_named() {
    let (mut count, mut unnamed) = (0, vec![]);
    for (k, (mut shop, noise)) in shops().into_iter().enumerate() {
        shop.build(40 + k as u64);
        let good = Table::new(&shop.table(2, noise));
        let unit = shop.setup.gauge.scale.name();
        let mut cases = in_any_table(&good, unit);
        let line = |row: usize| good.line(row);
        let (low, high) = good.extremes(30);
        let moved = |column: &str| format!(" in column {column} would fit if moved by a row");
        match unit {
            "um" => {
                let both = good.with([7], READING, |x| x / 1e3).with([7], AGAIN, |x| x / 1e3);
                // Neighbors of the linear delta's rows have the same reading within the scatter.
                if k != 1 {
                    cases.extend([
                        (good.lower(low, high, AGAIN), line(low), moved("again")),
                        (good.lower(low, high, READING), line(low), moved("reading")),
                    ]);
                }
                cases.extend([
                    (both, line(7), " um of pose 7 ".into()),
                    (
                        good.with(1..=30, AGAIN, |x| x + 100.0),
                        line(1),
                        "in all rows the second run is +".into(),
                    ),
                    (
                        good.with(18..=30, AGAIN, |x| x - 100.0),
                        line(18),
                        format!("from line {} on the second run is -", line(18)),
                    ),
                ]);
            }
            _ => {
                let short = |column: usize| good.with(1..=30, column, |x| x - 6.35);
                let both = short(READING).with(1..=30, AGAIN, |x| x - 6.35);
                cases.extend([
                    (short(AGAIN), line(1), "the radius of a ball was left out in one run".into()),
                    (both, line(1), "all readings would fit if larger by 6.".into()),
                ]);
            }
        }
        assert!(shop.read(&good.text()).is_ok());
        for (table, line, expected) in cases {
            count += 1;
            let refused = shop.read(&table.text()).err().map_or("0:0".into(), |e| e.to_string());
            println!("{k} {refused}");
            let at: usize = refused.split(':').nth(1).unwrap().parse().unwrap();
            // Where a block of moved rows ends is not determined if neighbors have the same reading.
            let slack = if expected.contains("moved") { 2 } else { 0 };
            let is_named = at.abs_diff(line) <= slack && refused.contains(&expected);
            if !is_named {
                unnamed.push(format!("{k} {line} {expected}: {refused}"));
            }
        }
    }
    assert!(count >= 20 && unnamed.is_empty(), "{count}: {unnamed:#?}");
}

#[test]
fn good_tables_are_not_refused_even_of_a_gauge_that_is_worse_than_stated() {
    let mut shop = Shop::new("lab-hexapod", &dial([0.0, 0.0, 580.0], 120.0, false, "mm"), 0.1);
    // The last one fits badly by chance, and better with a large offset.
    for seed in (500..500 + cases(20) as u64).chain([773]) {
        shop.build(seed);
        for noise in [0.5, 2.0, 8.0] {
            let table = shop.table(2, noise);
            if let Err(refused) = shop.read(&table) {
                panic!("{seed} {noise}: {refused}");
            }
        }
    }
}
