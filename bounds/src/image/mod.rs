//! A linked image for a Cortex-M: its functions, their code, and how they are called.

mod code;
mod effect;
mod flow;
mod graph;
mod source;

pub(crate) use flow::Analysis;
pub(crate) use graph::{Block, Graph, Loop};
pub(crate) use source::{Line, plain};

use std::{collections::BTreeMap, path::Path};

use anyhow::{Context, Result, bail};
use object::{Architecture, Object, ObjectSection, ObjectSymbol, SymbolKind};

/// What the names of the entries begin with.
pub(crate) const ENTRY: &str = "entry_";

/// A function of the image.
pub(crate) struct Function {
    /// Demangled, without the hash.
    pub(crate) name: String,
    /// First address after it.
    end: u32,
}

/// The functions of an image by their address, and its code.
pub(crate) struct Image {
    functions: BTreeMap<u32, Function>,
    code: code::Code,
    /// Where the code comes from.
    pub(crate) lines: source::Lines,
    /// Frames as the compiler tells them, by function; empty if it was not asked to.
    told: BTreeMap<u32, u32>,
    /// Bytes of the symbol `DETECTOR`.
    pub(crate) detector_bytes: Option<u64>,
    /// Names that an allocator would have.
    pub(crate) allocators: Vec<String>,
}

impl Image {
    /// Reads a linked ELF file.
    ///
    /// # Errors
    /// The file cannot be read, or is none for a Cortex-M.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| {
            format!("cannot read the image {}: make it with bounds/entries/build (docs/bounds.md)", path.display())
        })?;
        Self::parse(&bytes).with_context(|| format!("the image {} cannot be used", path.display()))
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let file = object::File::parse(bytes).context("no ELF file")?;
        if file.architecture() != Architecture::Arm {
            bail!("it is for {:?}; depths are found in images for thumbv7em-none-eabihf", file.architecture());
        }
        let mut functions = BTreeMap::<u32, Function>::new();
        let (mut marks, mut detector_bytes, mut allocators) = (BTreeMap::new(), None, Vec::new());
        for symbol in file.symbols() {
            let name = symbol.name().unwrap_or_default();
            match name.get(..2) {
                Some("$t") => _ = marks.insert(symbol.address() as u32, code::Kind::Thumb),
                Some("$d") => _ = marks.insert(symbol.address() as u32, code::Kind::Data),
                Some("$a") => _ = marks.insert(symbol.address() as u32, code::Kind::Arm),
                _ => {}
            }
            if name == "DETECTOR" {
                detector_bytes = Some(symbol.size());
            }
            if is_allocator(name) {
                allocators.push(name.to_owned());
            }
            if symbol.kind() == SymbolKind::Text && !symbol.is_undefined() && !name.starts_with('$') {
                // The lowest bit says that it is Thumb code.
                let (address, size) = (symbol.address() as u32 & !1, symbol.size() as u32);
                let function = Function { name: demangled(name), end: address + size };
                let known = functions.entry(address).or_insert_with(|| Function { name: String::new(), end: address });
                // Functions that are the same share their code; an entry keeps its name.
                if known.name.is_empty() || function.name.starts_with(ENTRY) {
                    known.name = function.name;
                }
                known.end = known.end.max(function.end);
            }
        }
        let mut sections = Vec::new();
        for section in file.sections().filter(|section| section.kind() == object::SectionKind::Text) {
            let data = section.data().context("a section of code cannot be read")?;
            sections.push((section.address() as u32, data));
        }
        end_by_the_next(&mut functions, &sections);
        let code = code::Code::disassemble(&sections, &marks)?;
        let told = match file.section_by_name(".stack_sizes") {
            Some(section) => told_frames(section.data().context("the sizes of the frames cannot be read")?)?,
            None => BTreeMap::new(),
        };
        let lines = source::Lines::of(&file)?;
        Ok(Self { functions, code, lines, told, detector_bytes, allocators })
    }

    /// Addresses of the entries, by name.
    pub(crate) fn entries(&self) -> impl Iterator<Item = (u32, &str)> {
        self.functions
            .iter()
            .filter(|(_, function)| function.name.starts_with(ENTRY))
            .map(|(address, function)| (*address, function.name.as_str()))
    }

    /// Whether an address lies in the function at `start`.
    fn is_inside(&self, start: u32, address: u32) -> bool {
        self.functions.get(&start).is_some_and(|function| (start..function.end).contains(&address))
    }

    /// The mnemonic of an instruction that reads or writes memory.
    pub(crate) fn memory_mnemonic(&self, address: u32) -> Option<&str> {
        let instruction = self.code.at(address)?;
        let is_memory =
            ["ldr", "str", "vldr", "vstr", "ldm", "stm"].iter().any(|name| instruction.mnemonic.starts_with(name));
        is_memory.then_some(instruction.mnemonic.as_str())
    }

    /// The number that argument `nth` of the only call of a block is, where the code of the block says so.
    pub(crate) fn argument(&self, block: &[u32], nth: u16) -> Option<u32> {
        let code: Option<Vec<_>> = block.iter().map(|address| self.code.at(*address)).collect();
        code::argument(&code?, nth)
    }

    /// The address of a function, by its name.
    pub(crate) fn address(&self, name: &str) -> Option<u32> {
        self.functions.iter().find(|(_, function)| function.name == name).map(|(address, _)| *address)
    }

    /// The name of the function at an address.
    pub(crate) fn name(&self, address: u32) -> &str {
        self.functions.get(&address).map_or("?", |function| &function.name)
    }
}

/// The section that the compiler writes: an address, and a number in LEB128, for each function.
fn told_frames(mut bytes: &[u8]) -> Result<BTreeMap<u32, u32>> {
    let mut told = BTreeMap::new();
    while let Some((address, mut rest)) = bytes.split_first_chunk::<4>() {
        let (mut size, mut shift) = (0u64, 0u32);
        loop {
            let Some((&byte, after)) = rest.split_first().filter(|_| shift < 63) else {
                bail!("the sizes of the frames end in the middle of a number");
            };
            size |= u64::from(byte & 0x7f) << shift;
            (rest, shift) = (after, shift + 7);
            if byte & 0x80 == 0 {
                break;
            }
        }
        told.insert(u32::from_le_bytes(*address) & !1, u32::try_from(size).unwrap_or(u32::MAX));
        bytes = rest;
    }
    Ok(told)
}

/// A function without a size, as assembly may have them, ends where the next one begins.
fn end_by_the_next(functions: &mut BTreeMap<u32, Function>, sections: &[(u32, &[u8])]) {
    let starts = functions.keys().copied().collect::<Vec<_>>();
    for (i, start) in starts.iter().enumerate() {
        let within = sections.iter().find(|(address, data)| (*address..*address + data.len() as u32).contains(start));
        let end = within.map_or(*start, |(address, data)| address + data.len() as u32);
        let next = starts.get(i + 1).map_or(end, |next| end.min(*next));
        if let Some(function) = functions.get_mut(start).filter(|function| function.end <= *start) {
            function.end = next;
        }
    }
}

fn demangled(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}

fn is_allocator(name: &str) -> bool {
    let plain = demangled(name);
    ["__rust_alloc", "__rust_realloc", "__rust_dealloc", "__rg_alloc", "malloc", "calloc", "realloc", "free", "_sbrk"]
        .iter()
        .any(|allocator| plain == *allocator || plain.ends_with(&format!("::{allocator}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_the_compiler_tells_are_read() {
        let section = [0x01, 0x80, 0, 0, 0xb0, 0x09, 0x11, 0x80, 0, 0, 0x08];
        assert_eq!(told_frames(&section).unwrap(), BTreeMap::from([(0x8000, 1200), (0x8010, 8)]));
        assert!(told_frames(&section[..5]).is_err());
        assert!(told_frames(&[]).unwrap().is_empty());
    }

    #[test]
    fn allocators_are_known_by_name() {
        assert!(["malloc", "__rust_alloc", "_sbrk"].into_iter().all(is_allocator));
        assert!(!["entry_wire_frame", "memcpy", "mallocate"].into_iter().any(is_allocator));
    }
}
