// SPDX-License-Identifier: GPL-2.0-or-later
//! The functions that an entry point reaches, and the largest stack depth on their paths.

use crate::built::{Built, Pointer};
use crate::walk::{Walked, walk};
use std::collections::{BTreeMap, BTreeSet};

/// All walked functions, by address.
pub struct Graph<'a> {
    built: &'a Built,
    walked: BTreeMap<u64, Walked>,
    deepest: BTreeMap<u64, Deepest>,
}

/// The deepest chain of calls from a function.
#[derive(Clone, Debug, Default)]
struct Deepest {
    stack: u64,
    next: Option<Pointer>,
}

/// The properties of an entry point.
#[derive(Clone, Debug, Default)]
pub struct Reached {
    /// Largest stack in bytes, including return addresses, without the stack of imports.
    pub stack: u64,
    /// The chain of calls that needs it.
    pub chain: Vec<String>,
    /// Imports that it may call.
    pub imports: BTreeSet<String>,
    /// Functions that it may call.
    pub functions: BTreeSet<u64>,
    /// Functions that call themselves, directly or indirectly.
    pub recursive: BTreeSet<String>,
}

impl<'a> Graph<'a> {
    /// Creates the graph of a library.
    pub fn new(built: &'a Built) -> Self {
        Self { built, walked: BTreeMap::new(), deepest: BTreeMap::new() }
    }

    pub fn walked(&mut self, address: u64) -> &Walked {
        self.walked.entry(address).or_insert_with(|| {
            self.built.function(address).map(|f| walk(self.built, f)).unwrap_or_default()
        })
    }

    /// Returns everything that an entry point reaches.
    pub fn reached(&mut self, entry: u64) -> Reached {
        let mut reached = Reached::default();
        let mut path = Vec::new();
        let deepest = self.descend(entry, &mut path, &mut reached.recursive);
        // The return address of the entry point itself.
        reached.stack = deepest.stack + 8;
        let mut at = Some(Pointer::Here(entry));
        while let Some(pointer) = at {
            reached.chain.push(self.name(&pointer));
            at = match pointer {
                Pointer::Here(address) => self.deepest.get(&address).and_then(|d| d.next.clone()),
                Pointer::Import(_) => None,
            };
        }
        self.collect(entry, &mut reached);
        reached
    }

    fn name(&self, pointer: &Pointer) -> String {
        match pointer {
            Pointer::Import(name) => name.clone(),
            Pointer::Here(address) => {
                self.built.function(*address).map_or(format!("{address:#x}"), |f| f.name.clone())
            }
        }
    }

    fn descend(
        &mut self,
        address: u64,
        path: &mut Vec<u64>,
        recursive: &mut BTreeSet<String>,
    ) -> Deepest {
        if path.contains(&address) {
            recursive.insert(self.name(&Pointer::Here(address)));
            return Deepest::default();
        }
        if let Some(known) = self.deepest.get(&address) {
            return known.clone();
        }
        path.push(address);
        let walked = self.walked(address).clone();
        let mut deepest = Deepest { stack: walked.depth, next: None };
        for call in &walked.calls {
            let below = match &call.to {
                Pointer::Here(to) => self.descend(*to, path, recursive).stack,
                Pointer::Import(_) => 0,
            };
            if call.depth + below > deepest.stack {
                deepest = Deepest { stack: call.depth + below, next: Some(call.to.clone()) };
            }
        }
        path.pop();
        // A function of a cycle is visited again from every entry point, and named again.
        if recursive.is_empty() {
            self.deepest.insert(address, deepest.clone());
        }
        deepest
    }

    fn collect(&mut self, address: u64, reached: &mut Reached) {
        if !reached.functions.insert(address) {
            return;
        }
        for call in self.walked(address).calls.clone() {
            match call.to {
                Pointer::Here(to) => self.collect(to, reached),
                Pointer::Import(name) => {
                    reached.imports.insert(name);
                }
            }
        }
    }
}
