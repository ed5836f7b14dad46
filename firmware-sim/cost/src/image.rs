//! What an image holds: sections, and functions by the crate they come from.

use std::collections::BTreeMap;
use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::error::CostError;
use crate::report::{Function, StackBound, Static};
use crate::stack;

/// Origin of what runs before and around everything.
pub const STARTUP: &str = "startup";

/// Origin of an image's own functions but `main`: in the footprint images they only call the
/// runtime, so what they hold is the runtime's, inlined.
pub const CALLERS: &str = "callers";

/// The function that runs first and calls everything else.
pub const RESET: &str = "Reset";

/// Functions of `cortex-m-rt`, whose names are not mangled.
const OF_STARTUP: [&str; 8] = [
    RESET,
    "main",
    "HardFault",
    "HardFault_",
    "HardFaultTrampoline",
    "DefaultHandler_",
    "DefaultPreInit",
    "__pre_init",
];

/// An image read from its ELF file.
#[derive(Debug)]
pub struct Image {
    /// Bytes by section, those that are loaded or take memory.
    pub sections: BTreeMap<String, u64>,
    /// In the order of their addresses.
    pub functions: Vec<Function>,
    /// Bytes of the statics that have a name.
    pub statics: Vec<Static>,
    /// What the compiler left of its version.
    pub compiler: Option<String>,
    /// Code by address, for the bound of the stack.
    code: stack::Code,
}

impl Image {
    /// Reads an image.
    ///
    /// # Errors
    /// [`CostError::Io`], [`CostError::Elf`].
    pub fn read(path: &Path) -> Result<Self, CostError> {
        let contents = std::fs::read(path).map_err(|source| CostError::Io {
            what: path.display().to_string(),
            source,
        })?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(&contents, &name).map_err(|source| CostError::Elf {
            path: path.to_owned(),
            source,
        })
    }

    fn parse(contents: &[u8], image: &str) -> object::Result<Self> {
        let file = object::File::parse(contents)?;
        let mut sections = BTreeMap::new();
        for section in file.sections() {
            let object::SectionFlags::Elf { sh_flags } = section.flags() else {
                continue;
            };
            if sh_flags & u64::from(object::elf::SHF_ALLOC) != 0 {
                sections.insert(section.name()?.to_owned(), section.size());
            }
        }
        let mut functions = BTreeMap::new();
        let mut statics = Vec::new();
        for symbol in file.symbols().filter(|symbol| symbol.size() > 0) {
            let mangled = symbol.name()?;
            // What the footprint images share stands in a module of each.
            let name = format!("{:#}", rustc_demangle::demangle(mangled))
                .replace(&format!("{image}::footprint::"), &format!("{image}::"));
            match symbol.kind() {
                SymbolKind::Text => {
                    // The lowest bit says Thumb. Functions may have several names: the first stays.
                    let address = symbol.address() & !1;
                    functions.entry(address).or_insert_with(|| Function {
                        origin: origin_of(mangled, &name, image),
                        name,
                        bytes: symbol.size(),
                        address,
                    });
                }
                SymbolKind::Data if !name.starts_with('.') => statics.push(Static {
                    name,
                    bytes: symbol.size(),
                }),
                _ => {}
            }
        }
        statics.sort_by(|a, b| (b.bytes, &a.name).cmp(&(a.bytes, &b.name)));
        let functions: Vec<Function> = functions.into_values().collect();
        Ok(Self {
            code: stack::Code::read(&file, &functions)?,
            compiler: compiler(&file)?,
            sections,
            functions,
            statics,
        })
    }

    /// Bytes of a section; 0 if there is none.
    pub fn section(&self, name: &str) -> u64 {
        self.sections.get(name).copied().unwrap_or(0)
    }

    /// Bytes of RAM that are taken for good, so all but the stack.
    pub fn ram_besides_stack(&self) -> u64 {
        [".data", ".bss", ".uninit"]
            .map(|section| self.section(section))
            .iter()
            .sum()
    }

    /// Bytes of code by the crate they come from.
    pub fn code_by_origin(&self) -> BTreeMap<String, u64> {
        let mut bytes = BTreeMap::new();
        for function in &self.functions {
            *bytes.entry(function.origin.clone()).or_default() += function.bytes;
        }
        bytes
    }

    /// Functions that a panic would need.
    pub fn panics(&self) -> Vec<String> {
        let names = self.functions.iter().map(|function| &function.name);
        names
            .filter(|name| name.contains("panic"))
            .cloned()
            .collect()
    }

    /// Most bytes of stack that a function of the image's own crate can take, with all that it
    /// calls, below its caller's frame; or [`RESET`].
    pub fn stack_bound(&self, image: &str, function: &str) -> StackBound {
        let path = format!("{image}::{function}");
        let is_it = |found: &&Function| found.name == path || found.name == function;
        match self.functions.iter().find(is_it) {
            Some(found) => self.code.bound(found.address),
            None => StackBound::Unknown(format!("there is no {function} in the image")),
        }
    }
}

fn origin_of(mangled: &str, name: &str, image: &str) -> String {
    if OF_STARTUP.contains(&mangled) || name.ends_with("::__cortex_m_rt_main") {
        return STARTUP.to_owned();
    }
    if name == mangled {
        // What the compiler calls by itself, such as memcpy.
        return "compiler_builtins".to_owned();
    }
    let path = name.trim_start_matches(['<', '&', '[', '(']);
    let path = path.strip_prefix("mut ").unwrap_or(path);
    let origin = path.split("::").next().unwrap_or(path);
    if origin == image {
        return CALLERS.to_owned();
    }
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    if origin.chars().all(is_name) {
        origin.to_owned()
    } else {
        "other".to_owned()
    }
}

/// The compiler's own line in the section that tools sign.
fn compiler(file: &object::File<'_>) -> object::Result<Option<String>> {
    let Some(section) = file.section_by_name(".comment") else {
        return Ok(None);
    };
    let data = section.data()?;
    let lines = data.split(|byte| *byte == 0).map(String::from_utf8_lossy);
    let mut rustc = lines.filter(|line| line.starts_with("rustc"));
    Ok(rustc
        .next()
        .map(|line| line.replace("rustc version", "rustc")))
}
