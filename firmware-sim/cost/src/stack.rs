//! An upper bound of the stack that a function can take, from the code itself.
//!
//! Every instruction of an image is looked at. What lowers the stack pointer by a constant (`push`,
//! `vpush`, `sub sp`, stores with write-back) counts for its function, all of it at once, whatever the
//! order and the branches; every `bl` and every branch out of a function is a call. Anything else that
//! could lower the stack pointer or go elsewhere (a computed call, a stack pointer from a register),
//! and recursion, gives no bound rather than a wrong one.
//!
//! Instructions and their encodings: Arm v7-M Architecture Reference Manual (DDI 0403), A5 and A7.

use std::collections::BTreeMap;

use object::{Object, ObjectSection, ObjectSymbol};

use crate::report::{Function, StackBound};

/// The code of an image as far as the stack is concerned, by the address of each function.
#[derive(Debug, Default)]
pub struct Code(BTreeMap<u64, Frame>);

/// What one function does to the stack.
#[derive(Debug, Default, PartialEq, Eq)]
struct Frame {
    name: String,
    /// Behind its last byte.
    end: u64,
    bytes: u32,
    calls: Vec<u64>,
    unclear: Option<String>,
}

impl Code {
    /// Looks at every function of the image.
    pub fn read(file: &object::File<'_>, functions: &[Function]) -> object::Result<Self> {
        let Some(text) = file.section_by_name(".text") else {
            return Ok(Self::default());
        };
        let data = text.data()?;
        // $t and $d say where Thumb code and where literals begin.
        let mut marks = BTreeMap::new();
        for symbol in file.symbols() {
            let name = symbol.name()?;
            if name.starts_with("$t") || name.starts_with("$d") {
                marks.insert(symbol.address(), name.starts_with("$t"));
            }
        }
        let mut code = BTreeMap::new();
        for function in functions {
            let start = function.address.saturating_sub(text.address()) as usize;
            let Some(bytes) = data.get(start..start.saturating_add(function.bytes as usize)) else {
                continue;
            };
            let is_code = |address: u64| {
                let mark = marks.range(..=address).next_back();
                mark.is_none_or(|(_, is_code)| *is_code)
            };
            let mut frame = frame_of(bytes, function.address, is_code);
            frame.name.clone_from(&function.name);
            code.insert(function.address, frame);
        }
        Ok(Self(code))
    }

    /// The bound of the function at this address.
    pub fn bound(&self, address: u64) -> StackBound {
        match self.depth(address, &mut Vec::new()) {
            Ok(bytes) => StackBound::Bytes(bytes),
            Err(reason) => StackBound::Unknown(reason),
        }
    }

    fn depth(&self, address: u64, callers: &mut Vec<u64>) -> Result<u32, String> {
        // A branch may go into another function, behind its start.
        let (start, frame) = self
            .0
            .range(..=address)
            .next_back()
            .ok_or_else(|| format!("a call of {address:#x}, where no function is"))?;
        if address >= frame.end {
            return Err(format!("a call of {address:#x}, where no function is"));
        }
        if let Some(reason) = &frame.unclear {
            return Err(format!("{} {reason}", frame.name));
        }
        if callers.contains(start) {
            return Err(format!("{} calls itself", frame.name));
        }
        callers.push(*start);
        let mut deepest = 0;
        for call in &frame.calls {
            deepest = deepest.max(self.depth(*call, callers)?);
        }
        callers.pop();
        Ok(frame.bytes + deepest)
    }
}

/// What one instruction does, as far as it matters here.
#[derive(Debug, PartialEq, Eq)]
enum Effect {
    None,
    /// Lowers the stack pointer by so many bytes.
    Lowers(u32),
    /// Goes to an address, and comes back.
    Calls(u64),
    /// Goes to an address: inside of the function, or out of it for good.
    Jumps(u64),
    Unclear(&'static str),
}

fn frame_of(bytes: &[u8], address: u64, is_code: impl Fn(u64) -> bool) -> Frame {
    let mut frame = Frame {
        end: address + bytes.len() as u64,
        ..Frame::default()
    };
    let own = address..frame.end;
    let mut halves = (address..)
        .step_by(2)
        .zip(bytes.as_chunks::<2>().0)
        .filter(|(here, _)| is_code(*here))
        .map(|(here, half)| (here, u16::from_le_bytes(*half)));
    while let Some((here, first)) = halves.next() {
        let effect = if first >> 11 < 0b11101 {
            narrow(first, here)
        } else {
            let second = halves.next().map_or(0, |(_, second)| second);
            wide(first, second, here)
        };
        match effect {
            Effect::None => {}
            Effect::Lowers(bytes) => frame.bytes += bytes,
            Effect::Jumps(to) if own.contains(&to) => {}
            Effect::Jumps(to) | Effect::Calls(to) => frame.calls.push(to),
            Effect::Unclear(reason) => {
                frame
                    .unclear
                    .get_or_insert(format!("{reason} at {here:#x}"));
            }
        }
    }
    frame.calls.sort_unstable();
    frame.calls.dedup();
    frame
}

const SP: u16 = 13;
const LR: u16 = 14;
const PC: u16 = 15;

const COMPUTED: &str = "goes to a computed address";
const MOVED: &str = "computes its stack pointer";

/// An instruction of one half-word.
fn narrow(code: u16, here: u64) -> Effect {
    let rd = code & 7 | code >> 4 & 8;
    let rm = code >> 3 & 15;
    match code >> 8 {
        // push {registers, lr}
        0xb4 | 0xb5 => Effect::Lowers(4 * (code & 0x1ff).count_ones()),
        // sub sp, #imm; add sp, #imm is the same with the bit clear
        0xb0 if code & 0x80 != 0 => Effect::Lowers(4 * u32::from(code & 0x7f)),
        // add rd, rm; mov rd, rm
        0x44 | 0x46 if rd == SP => Effect::Unclear(MOVED),
        0x44 | 0x46 if rd == PC => Effect::Unclear(COMPUTED),
        // bx lr returns; bx rm, blx rm go anywhere
        0x47 if code & 0x80 != 0 || rm != LR => Effect::Unclear(COMPUTED),
        // b with a condition; behind the last one are udf and svc
        0xd0..=0xdd => jump(here, i64::from(code as u8 as i8) << 1),
        // b
        0xe0..=0xe7 => jump(here, i64::from((code << 5) as i16) >> 4),
        // cbz, cbnz
        0xb1 | 0xb3 | 0xb9 | 0xbb => jump(here, i64::from(code >> 3 & 0x40 | code >> 2 & 0x3e)),
        _ => Effect::None,
    }
}

/// An instruction of two half-words.
fn wide(first: u16, second: u16, here: u64) -> Effect {
    match (first >> 11, second >> 15) {
        (0b11110, 0) => immediate(first, second),
        (0b11110, _) => branch(first, second, here),
        (0b11101, _) => multiple_or_shifted(first, second),
        _ => single(first, second),
    }
}

/// Data processing with a constant: A5.3.1, A5.3.3.
fn immediate(first: u16, second: u16) -> Effect {
    if second >> 8 & 15 != SP {
        return Effect::None;
    }
    let imm12 = u32::from(first >> 10 & 1) << 11
        | u32::from(second >> 12 & 7) << 8
        | u32::from(second & 0xff);
    match (first & 0xfbef, first & 0xfbff) {
        // sub.w sp, sp, #constant; subw sp, sp, #imm12
        (0xf1ad, _) => Effect::Lowers(expanded(imm12)),
        (_, 0xf2ad) => Effect::Lowers(imm12),
        // add.w, unless it wraps round; addw
        (0xf10d, _) if expanded(imm12) < 1 << 31 => Effect::None,
        (_, 0xf20d) => Effect::None,
        _ => Effect::Unclear(MOVED),
    }
}

/// The constant of twelve bits: A5.3.2.
fn expanded(imm12: u32) -> u32 {
    let byte = imm12 & 0xff;
    match imm12 >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (byte | 0x80).rotate_right(imm12 >> 7),
    }
}

/// Branches and what shares their space: A5.3.4.
fn branch(first: u16, second: u16, here: u64) -> Effect {
    let bit = |half: u16, k: u16| i64::from(half >> k & 1);
    let (s, j1, j2) = (bit(first, 10), bit(second, 13), bit(second, 11));
    let low = i64::from(second & 0x7ff) << 1;
    let is_call = second & 0x4000 != 0;
    if second & 0x1000 == 0 {
        if !is_call && first >> 7 & 7 != 0b111 {
            // b.w with a condition
            let offset = j2 << 19 | j1 << 18 | i64::from(first & 0x3f) << 12 | low;
            return jump(here, offset - (s << 20));
        }
        // msr to one of the two stack pointers
        let writes_pointer = first & 0xffe0 == 0xf380 && matches!(second & 0xff, 8 | 9);
        return if writes_pointer {
            Effect::Unclear(MOVED)
        } else {
            Effect::None
        };
    }
    let (i1, i2) = (1 ^ j1 ^ s, 1 ^ j2 ^ s);
    let offset = i1 << 23 | i2 << 22 | i64::from(first & 0x3ff) << 12 | low;
    let to = target(here, offset - (s << 24));
    if is_call {
        Effect::Calls(to)
    } else {
        Effect::Jumps(to)
    }
}

/// Several registers at once, those of the floating-point unit too, and operands that are shifted:
/// A5.3.5, A5.3.6, A5.3.11, A5.3.18.
fn multiple_or_shifted(first: u16, second: u16) -> Effect {
    let (is_down, writes_back) = (first & 0x80 == 0, first & 0x20 != 0);
    let is_on_stack = first & 15 == SP;
    let pops = is_on_stack && first & 0xffd0 == 0xe890;
    match first >> 9 {
        // stm, ldm
        0b1110100 if first & 0x40 == 0 => {
            let is_before = first & 0x100 != 0;
            if is_on_stack && writes_back && is_before {
                Effect::Lowers(4 * second.count_ones())
            } else if second & 1 << PC != 0 && first & 0x10 != 0 && !pops {
                Effect::Unclear(COMPUTED)
            } else {
                Effect::None
            }
        }
        // strd, ldrd; tbb and tbh among them stay in the function. vstm, vldm, vpush
        0b1110100 | 0b1110110 if is_on_stack && writes_back && is_down => {
            Effect::Lowers(4 * u32::from(second & 0xff))
        }
        0b1110101 if second >> 8 & 15 == SP => Effect::Unclear(MOVED),
        _ => Effect::None,
    }
}

/// One register from or to memory: A5.3.7 to A5.3.10. What else is here cannot write the stack
/// pointer.
fn single(first: u16, second: u16) -> Effect {
    let is_on_stack = first & 15 == SP;
    if first >> 9 != 0b1111100 {
        return Effect::None;
    }
    let loads_word = first & 0x70 == 0x50;
    if loads_word && second >> 12 == SP {
        return Effect::Unclear(MOVED);
    }
    // ldr pc, [sp], #imm returns
    if loads_word && second >> 12 == PC && !is_on_stack {
        return Effect::Unclear(COMPUTED);
    }
    let has_imm8 = first & 0x80 == 0 && second & 0x800 != 0;
    let lowers = second & 0x100 != 0 && second & 0x200 == 0;
    if is_on_stack && has_imm8 && lowers {
        return Effect::Lowers(u32::from(second & 0xff));
    }
    Effect::None
}

fn jump(here: u64, offset: i64) -> Effect {
    Effect::Jumps(target(here, offset))
}

/// Offsets count from four bytes behind the instruction.
fn target(here: u64, offset: i64) -> u64 {
    here.wrapping_add(4).wrapping_add_signed(offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_do_what_the_manual_says() {
        // As an assembler encodes them.
        let narrow_ones = [
            (0xb5f0, Effect::Lowers(20)),        // push {r4-r7, lr}
            (0xb082, Effect::Lowers(8)),         // sub sp, #8
            (0xb002, Effect::None),              // add sp, #8
            (0x4770, Effect::None),              // bx lr
            (0x4718, Effect::Unclear(COMPUTED)), // bx r3
            (0x4798, Effect::Unclear(COMPUTED)), // blx r3
            (0x46bd, Effect::Unclear(MOVED)),    // mov sp, r7
            (0x466f, Effect::None),              // mov r7, sp
            (0xe7fe, Effect::Jumps(0x1000)),     // b .
            (0xd1fc, Effect::Jumps(0x0ffc)),     // bne .-4
            (0xb108, Effect::Jumps(0x1006)),     // cbz r0, .+6
            (0xbb08, Effect::Jumps(0x1046)),     // cbnz r0, .+70
        ];
        for (code, effect) in narrow_ones {
            assert_eq!(narrow(code, 0x1000), effect, "{code:04x}");
        }
        let wide_ones = [
            ([0xe92d, 0x4ff0], Effect::Lowers(36)), // push.w {r4-r11, lr}
            ([0xe8bd, 0x8ff0], Effect::None),       // pop.w {r4-r11, pc}
            ([0xed2d, 0x8b10], Effect::Lowers(64)), // vpush {d8-d15}
            ([0xecbd, 0x8b10], Effect::None),       // vpop {d8-d15}
            ([0xf84d, 0x8d04], Effect::Lowers(4)),  // str r8, [sp, #-4]!
            ([0xf85d, 0xfb04], Effect::None),       // ldr pc, [sp], #4
            ([0xf85d, 0x8b04], Effect::None),       // ldr r8, [sp], #4
            ([0xf85d, 0xd004], Effect::Unclear(MOVED)), // ldr.w sp, [sp, r4]
            ([0xf8df, 0xf000], Effect::Unclear(COMPUTED)), // ldr.w pc, [pc]
            ([0xe96d, 0x0102], Effect::Lowers(8)),  // strd r0, r1, [sp, #-8]!
            ([0xe9cd, 0x0102], Effect::None),       // strd r0, r1, [sp, #8]
            ([0xf5ad, 0x7d00], Effect::Lowers(512)), // sub.w sp, sp, #512
            ([0xf2ad, 0x4d04], Effect::Lowers(1028)), // subw sp, sp, #1028
            ([0xf50d, 0x7d00], Effect::None),       // add.w sp, sp, #512
            ([0xf02d, 0x0d07], Effect::Unclear(MOVED)), // bic sp, sp, #7
            ([0xe8df, 0xf000], Effect::None),       // tbb [pc, r0]
            ([0xf7ff, 0xfffe], Effect::Calls(0x1000)), // bl .
            ([0xf000, 0xf800], Effect::Calls(0x1004)), // bl .+4
            ([0xf7ff, 0xbffe], Effect::Jumps(0x1000)), // b.w .
            ([0xf43f, 0xaffe], Effect::Jumps(0x1000)), // beq.w .
            ([0xf380, 0x8808], Effect::Unclear(MOVED)), // msr msp, r0
            ([0xf3bf, 0x8f4f], Effect::None),       // dsb sy
        ];
        for ([first, second], effect) in wide_ones {
            let found = wide(first, second, 0x1000);
            assert_eq!(found, effect, "{first:04x} {second:04x}");
        }
    }

    fn code(frames: &[(u64, u32, &[u64], Option<&str>)]) -> Code {
        let frame = |&(address, bytes, calls, unclear): &(u64, u32, &[u64], Option<&str>)| {
            let frame = Frame {
                name: format!("f{address}"),
                end: address + 10,
                bytes,
                calls: calls.to_vec(),
                unclear: unclear.map(str::to_owned),
            };
            (address, frame)
        };
        Code(frames.iter().map(frame).collect())
    }

    #[test]
    fn the_deepest_path_counts_and_what_is_unclear_gives_no_bound() {
        let frames: [(u64, u32, &[u64], Option<&str>); 6] = [
            (0, 8, &[10, 20], None),
            (10, 16, &[20], None),
            (20, 4, &[], None),
            (30, 4, &[0, 40], None),
            (40, 4, &[30], None),
            (50, 0, &[], Some(COMPUTED)),
        ];
        let code = code(&frames);
        assert_eq!(code.bound(0), StackBound::Bytes(28));
        assert_eq!(
            code.bound(30),
            StackBound::Unknown("f30 calls itself".into())
        );
        let StackBound::Unknown(reason) = code.bound(50) else {
            panic!("a bound of what is unclear");
        };
        assert!(reason.contains(COMPUTED), "{reason}");
        assert!(matches!(code.bound(60), StackBound::Unknown(_)));
    }

    #[test]
    fn literals_are_no_instructions() {
        // push {r4, lr}, then a literal that reads as push {r4-r7, lr}.
        let bytes = [0x10, 0xb5, 0xf0, 0xb5];
        assert_eq!(frame_of(&bytes, 0x100, |at| at < 0x102).bytes, 8);
        assert_eq!(frame_of(&bytes, 0x100, |_| true).bytes, 28);
    }
}
