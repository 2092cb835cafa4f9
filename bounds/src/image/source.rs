//! The lines of source that machine code comes from.

use std::{borrow::Cow, rc::Rc};

use anyhow::{Context, Result};
use gimli::{EndianRcSlice, RunTimeEndian};
use object::{Object, ObjectSection};

/// A line of source, and the function that it stands in.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Line {
    /// Without what it is generic over.
    pub(crate) function: String,
    pub(crate) file: String,
    pub(crate) line: u32,
}

/// What the compiler has written down about lines; nothing if it was not asked to.
#[derive(Default)]
pub(crate) struct Lines(Option<addr2line::Context<EndianRcSlice<RunTimeEndian>>>);

impl Lines {
    /// # Errors
    /// What was written down cannot be read.
    pub(super) fn of(file: &object::File<'_>) -> Result<Self> {
        let section = |id: gimli::SectionId| {
            let data = file.section_by_name(id.name()).map(|section| section.uncompressed_data());
            let data = data.unwrap_or(Ok(Cow::Borrowed(&[])))?;
            Ok::<_, object::Error>(EndianRcSlice::new(Rc::from(&*data), RunTimeEndian::Little))
        };
        let dwarf = gimli::Dwarf::load(section).context("the lines of source cannot be read")?;
        Ok(Self(Some(addr2line::Context::from_dwarf(dwarf).context("the lines of source cannot be read")?)))
    }

    /// The line of an address, and those of the calls that were inlined there, the innermost first.
    pub(crate) fn of_address(&self, address: u32) -> Vec<Line> {
        let mut lines = Vec::new();
        let Some(context) = &self.0 else { return lines };
        let Ok(mut frames) = context.find_frames(u64::from(address)).skip_all_loads() else { return lines };
        while let Ok(Some(frame)) = frames.next() {
            let function = frame.function.as_ref().and_then(|name| name.raw_name().ok().map(Cow::into_owned));
            let location = frame.location.as_ref();
            lines.push(Line {
                function: function.map(|name| plain(&name)).unwrap_or_default(),
                file: location.and_then(|at| at.file).unwrap_or_default().to_owned(),
                line: location.and_then(|at| at.line).unwrap_or_default(),
            });
        }
        lines
    }
}

/// A name without what is generic over: `<a::B<3> as c::D>::e::<F>` is `a::B::e`.
pub(crate) fn plain(name: &str) -> String {
    let name = rustc_demangle::demangle(name);
    let name = format!("{name:#}");
    let (mut out, mut depth) = (String::new(), 0);
    // An implementation stands in angles at the beginning: what comes before ` as `, without its own angles.
    let (head, rest) = match name.strip_prefix('<') {
        None => (String::new(), name.as_str()),
        Some(inner) => {
            let mut open = 1;
            let end = inner.char_indices().find(|(i, c)| {
                match c {
                    '<' => open += 1,
                    '>' if !inner[..*i].ends_with('-') => open -= 1,
                    _ => {}
                }
                open == 0
            });
            let end = end.map_or(inner.len(), |(i, _)| i);
            let mut level = 0;
            let split = inner[..end].char_indices().find(|(i, c)| {
                match c {
                    '<' | '(' | '[' => level += 1,
                    '>' | ')' | ']' if !inner[..*i].ends_with('-') => level -= 1,
                    _ => {}
                }
                level == 0 && inner[*i..end].starts_with(" as ")
            });
            (plain(&inner[..split.map_or(end, |(i, _)| i)]), inner.get(end + 1..).unwrap_or_default())
        }
    };
    for (i, c) in rest.char_indices() {
        match c {
            '<' => {
                if depth == 0 && out.ends_with("::") {
                    out.truncate(out.len() - 2);
                }
                depth += 1;
            }
            '>' if !rest[..i].ends_with('-') => depth -= 1,
            c if depth == 0 => out.push(c),
            _ => {}
        }
    }
    head + &out
}

impl Line {
    /// The file from the folder of the core on; `None` if it is none of the core.
    pub(crate) fn core_file(&self) -> Option<&str> {
        let (before, file) = self.file.rsplit_once("core/src/")?;
        (!before.ends_with("library/")).then_some(file)
    }
}

impl super::Image {
    /// The text of a line of the core; empty if it is not at hand.
    pub(crate) fn source(&self, file: &str, line: u32) -> String {
        let path = format!("core/src/{file}");
        let text = std::fs::read_to_string(path).unwrap_or_default();
        text.lines().nth((line as usize).saturating_sub(1)).unwrap_or_default().trim().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_told_without_what_they_are_generic_over() {
        assert_eq!(plain("<core_a::Matcher<320, 48>>::pass"), "core_a::Matcher::pass");
        assert_eq!(plain("<a::Ticket<a::Rows<3>> as b::Job>::run"), "a::Ticket::run");
        assert_eq!(plain("a::spread_line::<40>"), "a::spread_line");
        assert_eq!(plain("memcpy"), "memcpy");
    }

    #[test]
    fn lines_of_the_core_are_told_from_those_of_the_library_that_is_called_so_too() {
        let line = |file: &str| Line { file: file.to_owned(), ..Line::default() };
        assert_eq!(line("/any/where/core/src/wire/select.rs").core_file(), Some("wire/select.rs"));
        assert_eq!(line("/usr/lib/library/core/src/iter/range.rs").core_file(), None);
        assert_eq!(line("/any/where/libm/src/math.rs").core_file(), None);
    }
}
