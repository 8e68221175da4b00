// SPDX-License-Identifier: GPL-2.0-or-later
//! A shared library as written by its linker.

use object::elf::{
    DF_BIND_NOW, DF_TEXTREL, DT_BIND_NOW, DT_FLAGS, DT_TEXTREL, DynamicFlags, DynamicTag,
    FileHeader64, PF_W, PF_X, PT_DYNAMIC, PT_GNU_STACK, PT_LOAD, R_X86_64_64, R_X86_64_GLOB_DAT,
    R_X86_64_JUMP_SLOT, R_X86_64_RELATIVE,
};
use object::read::elf::{Dyn, ElfFile64, FileHeader, ProgramHeader};
use object::{
    Architecture, Endianness, Object, ObjectSection, ObjectSymbol, RelocationFlags,
    RelocationTarget, SymbolKind,
};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A function or another symbol that the file defines.
#[derive(Clone, Debug)]
pub struct Symbol {
    /// Demangled name, without the hash that the compiler adds.
    pub name: String,
    /// Start address.
    pub address: u64,
    /// Its length in bytes.
    pub size: u64,
    pub is_code: bool,
    /// Whether it is visible to other libraries.
    pub is_exported: bool,
}

/// The target of a pointer of the file once it is loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pointer {
    /// To a function of another library.
    Import(String),
    /// Into this library.
    Here(u64),
}

/// A segment of memory as the loader maps it.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    pub address: u64,
    /// Whether it is writable.
    pub is_writable: bool,
    /// Whether it is executable.
    pub is_executable: bool,
}

/// A shared library.
pub struct Built {
    /// Whether its instructions can be followed, and pointers are known: on x86-64. The rest is
    /// read for 64-bit ARM too.
    pub is_followed: bool,
    bytes: Vec<(Range<u64>, Vec<u8>)>,
    /// Symbols that it defines.
    pub symbols: Vec<Symbol>,
    /// Symbols that it imports; weak ones, which may stay undefined, too.
    pub imports: BTreeSet<String>,
    /// Pointers that the loader fills in, by their address.
    pub pointers: BTreeMap<u64, Pointer>,
    /// Functions whose address is in data, except those registered by the C start files.
    pub taken: BTreeSet<u64>,
    /// Mapped memory.
    pub segments: Vec<Segment>,
    /// Requested rights of the stack; `None` if the file does not specify them, which means all.
    pub stack: Option<Segment>,
    /// Whether the loader must change code.
    pub has_text_relocations: bool,
    /// Whether all symbols are resolved when the file is loaded.
    pub is_bound_at_load: bool,
}

impl Built {
    /// Reads a file.
    /// # Errors
    /// A message for the user of the check.
    pub fn read(data: &[u8]) -> Result<Built, String> {
        let file = ElfFile64::<Endianness>::parse(data).map_err(|e| format!("no ELF file: {e}"))?;
        let is_followed = match file.architecture() {
            Architecture::X86_64 => true,
            Architecture::Aarch64 => false,
            _ => return Err("neither x86-64 nor 64-bit ARM".into()),
        };
        let symbols = symbols(&file);
        if !symbols.iter().any(|s| s.is_code && !s.is_exported) {
            return Err("the file has no local symbols: build it with `make module`".into());
        }
        let pointers = pointers(&file);
        let mut built = Built {
            is_followed,
            bytes: contents(&file),
            taken: taken(&file, &symbols, &pointers),
            symbols,
            imports: file
                .dynamic_symbols()
                .filter(|s| s.is_undefined())
                .filter_map(|s| s.name().ok().map(str::to_owned))
                .filter(|name| !name.is_empty())
                .collect(),
            pointers,
            segments: Vec::new(),
            stack: None,
            has_text_relocations: false,
            is_bound_at_load: false,
        };
        built.read_headers(&file, data)?;
        Ok(built)
    }

    fn read_headers(
        &mut self,
        file: &ElfFile64<'_, Endianness>,
        data: &[u8],
    ) -> Result<(), String> {
        let endian = file.endian();
        let header = FileHeader64::<Endianness>::parse(data).map_err(|e| e.to_string())?;
        for program in header.program_headers(endian, data).map_err(|e| e.to_string())? {
            let flags = program.p_flags(endian);
            let segment = Segment {
                address: program.p_vaddr(endian),
                is_writable: flags.contains(PF_W),
                is_executable: flags.contains(PF_X),
            };
            match program.p_type(endian) {
                PT_LOAD => self.segments.push(segment),
                PT_GNU_STACK => self.stack = Some(segment),
                PT_DYNAMIC => {
                    let entries = program.dynamic(endian, data).map_err(|e| e.to_string())?;
                    for entry in entries.unwrap_or_default() {
                        self.read_dynamic(entry.d_tag(endian), entry.d_val(endian));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn read_dynamic(&mut self, tag: DynamicTag, value: u64) {
        let flag = |flag: DynamicFlags| tag == DT_FLAGS && value & flag.0 != 0;
        self.has_text_relocations |= tag == DT_TEXTREL || flag(DF_TEXTREL);
        self.is_bound_at_load |= tag == DT_BIND_NOW || flag(DF_BIND_NOW);
    }

    /// Returns the bytes of the file from an address to the end of its section.
    pub fn bytes(&self, address: u64) -> &[u8] {
        let section = self.bytes.iter().find(|(range, _)| range.contains(&address));
        section.map_or(&[], |(range, bytes)| &bytes[(address - range.start) as usize..])
    }

    /// Returns the function that begins at an address.
    pub fn function(&self, address: u64) -> Option<&Symbol> {
        self.symbols.iter().find(|s| s.is_code && s.address == address && s.size > 0)
    }

    pub fn function_named(&self, name: &str) -> Option<&Symbol> {
        self.symbols.iter().find(|s| s.is_code && s.name == name && s.size > 0)
    }
}

/// Demangles a name, without the compiler's hashes.
fn plain(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}

fn symbols(file: &ElfFile64<'_, Endianness>) -> Vec<Symbol> {
    let exported: BTreeSet<&str> = file
        .dynamic_symbols()
        .filter(|s| !s.is_undefined() && !s.is_local())
        .filter_map(|s| s.name().ok())
        .collect();
    file.symbols()
        .filter(|s| !s.is_undefined() && matches!(s.kind(), SymbolKind::Text | SymbolKind::Data))
        .filter_map(|s| {
            let name = s.name().ok()?;
            Some(Symbol {
                name: plain(name),
                address: s.address(),
                size: s.size(),
                is_code: s.kind() == SymbolKind::Text,
                is_exported: exported.contains(name) && s.is_global(),
            })
        })
        .collect()
}

fn contents(file: &ElfFile64<'_, Endianness>) -> Vec<(Range<u64>, Vec<u8>)> {
    let mut contents = Vec::new();
    for section in file.sections() {
        let bytes = section.data().unwrap_or_default();
        if section.address() != 0 && !bytes.is_empty() {
            let end = section.address() + bytes.len() as u64;
            contents.push((section.address()..end, bytes.to_vec()));
        }
    }
    contents
}

fn pointers(file: &ElfFile64<'_, Endianness>) -> BTreeMap<u64, Pointer> {
    let mut pointers = BTreeMap::new();
    for (place, relocation) in file.dynamic_relocations().into_iter().flatten() {
        let RelocationFlags::Elf { r_type } = relocation.flags() else { continue };
        let pointer = match (r_type, relocation.target()) {
            (R_X86_64_RELATIVE, _) => Pointer::Here(relocation.addend() as u64),
            (
                R_X86_64_64 | R_X86_64_GLOB_DAT | R_X86_64_JUMP_SLOT,
                RelocationTarget::Symbol(index),
            ) => {
                let table = file.dynamic_symbol_table().expect("it has dynamic relocations");
                let symbol = object::ObjectSymbolTable::symbol_by_index(&table, index);
                let Ok(symbol) = symbol else { continue };
                match symbol.is_undefined() {
                    true => Pointer::Import(symbol.name().unwrap_or_default().to_owned()),
                    false => Pointer::Here(symbol.address()),
                }
            }
            _ => continue,
        };
        pointers.insert(place, pointer);
    }
    pointers
}

/// Returns functions whose addresses the loader writes into data. Those in the tables of the C start
/// files run at load and unload.
fn taken(
    file: &ElfFile64<'_, Endianness>,
    symbols: &[Symbol],
    pointers: &BTreeMap<u64, Pointer>,
) -> BTreeSet<u64> {
    let outside: Vec<Range<u64>> = file
        .sections()
        .filter(|s| matches!(s.name(), Ok(".init_array" | ".fini_array" | ".got" | ".got.plt")))
        .map(|s| s.address()..s.address() + s.size())
        .collect();
    let code: BTreeSet<u64> = symbols.iter().filter(|s| s.is_code).map(|s| s.address).collect();
    pointers
        .iter()
        .filter(|(place, _)| !outside.iter().any(|range| range.contains(place)))
        .filter_map(|(_, pointer)| match pointer {
            Pointer::Here(address) if code.contains(address) => Some(*address),
            _ => None,
        })
        .collect()
}
