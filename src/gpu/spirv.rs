//! Reads SPIR-V modules, and adds execution modes to them for the device in use. glsl/generate.rs reads its
//! instructions through this file too.

use std::collections::HashMap;

/// Words before the first instruction.
const HEADER: usize = 5;
const MAGIC: u32 = 0x0723_0203;

/// Opcodes used here and in glsl/generate.rs.
#[allow(missing_docs, reason = "named as the SPIR-V specification names them")]
pub mod op {
    pub const NAME: u32 = 5;
    pub const EXTENSION: u32 = 10;
    pub const ENTRY_POINT: u32 = 15;
    pub const EXECUTION_MODE: u32 = 16;
    pub const CAPABILITY: u32 = 17;
    pub const TYPE_BOOL: u32 = 20;
    pub const TYPE_INT: u32 = 21;
    pub const TYPE_FLOAT: u32 = 22;
    pub const TYPE_VECTOR: u32 = 23;
    pub const TYPE_ARRAY: u32 = 28;
    pub const TYPE_POINTER: u32 = 32;
    pub const CONSTANT_FALSE: u32 = 42;
    pub const CONSTANT: u32 = 43;
    pub const CONSTANT_COMPOSITE: u32 = 44;
    pub const SPEC_CONSTANT: u32 = 50;
    pub const SPEC_CONSTANT_COMPOSITE: u32 = 51;
    pub const SPEC_CONSTANT_OP: u32 = 52;
    pub const FUNCTION: u32 = 54;
    pub const FUNCTION_CALL: u32 = 57;
    pub const VARIABLE: u32 = 59;
    pub const DECORATE: u32 = 71;
    pub const COMPOSITE_EXTRACT: u32 = 81;
    pub const I_ADD: u32 = 128;
    pub const I_SUB: u32 = 130;
    pub const I_MUL: u32 = 132;
    pub const U_DIV: u32 = 134;
    pub const U_MOD: u32 = 137;
    pub const SHIFT_RIGHT: u32 = 194;
    pub const SHIFT_LEFT: u32 = 196;
    pub const CONTROL_BARRIER: u32 = 224;
    pub const GROUP_NON_UNIFORM_FIRST: u32 = 333;
    pub const GROUP_NON_UNIFORM_BROADCAST: u32 = 337;
    pub const GROUP_NON_UNIFORM_LAST: u32 = 366;
}

/// The words of a module, if it is one.
pub fn words(bytes: &[u8]) -> Result<Vec<u32>, String> {
    let (chunks, rest) = bytes.as_chunks::<4>();
    let words: Vec<u32> = chunks.iter().map(|&b| u32::from_le_bytes(b)).collect();
    match words.first() {
        Some(&MAGIC) if rest.is_empty() && words.len() >= HEADER => Ok(words),
        _ => Err("expected a SPIR-V module of little-endian words".into()),
    }
}

/// The instructions of a module, each with its first word, which holds the opcode: see [`opcode`].
pub fn instructions(module: &[u32]) -> Result<Vec<&[u32]>, String> {
    let mut rest = module.get(HEADER..).ok_or("a module of fewer words than a header")?;
    let mut list = Vec::new();
    while let Some(first) = rest.first() {
        let length = (first >> 16) as usize;
        let (instruction, after) = rest.split_at_checked(length).ok_or("an instruction longer than its module")?;
        if length == 0 {
            return Err("an instruction of no words".into());
        }
        list.push(instruction);
        rest = after;
    }
    Ok(list)
}

/// The operation of an instruction, see [`op`].
pub fn opcode(instruction: &[u32]) -> u32 {
    instruction[0] & 0xFFFF
}

/// An execution mode, with the declarations it needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Its number in the SPIR-V specification.
    pub mode: u32,
    /// Literals behind the mode.
    pub operands: &'static [u32],
    /// Number of the capability that declares it.
    pub capability: Option<u32>,
    /// Name of the extension that defines it.
    pub extension: Option<&'static str>,
}

/// −0, infinities and NaN of float32 follow IEEE 754. Without it a compiler may assume that there are none,
/// and turn `!(x >= lo)` into `x < lo`.
pub const SIGNED_ZERO_INF_NAN_PRESERVE: Mode =
    Mode { mode: 4461, operands: &[32], capability: Some(4466), extension: None };
/// The lanes of a subgroup that diverge at a branch are together again at the point that the source implies.
pub const MAXIMALLY_RECONVERGES: Mode =
    Mode { mode: 6023, operands: &[], capability: None, extension: Some("SPV_KHR_maximal_reconvergence") };
/// Lanes reconverge likewise, but only if the whole subgroup reached the branch.
pub const SUBGROUP_UNIFORM_CONTROL_FLOW: Mode =
    Mode { mode: 4421, operands: &[], capability: None, extension: Some("SPV_KHR_subgroup_uniform_control_flow") };

/// The module with `modes` for each of its entry points.
pub fn with_modes(module: &[u32], modes: &[Mode]) -> Result<Vec<u32>, String> {
    let list = instructions(module)?;
    let entries: Vec<u32> = list.iter().filter(|i| opcode(i) == op::ENTRY_POINT).map(|i| i[2]).collect();
    let first = |codes: &[u32]| list.iter().position(|i| !codes.contains(&opcode(i))).unwrap_or(list.len());
    // Capabilities come first in a module, then extensions; entry points come right before execution modes.
    let capabilities_end = first(&[op::CAPABILITY]);
    let extensions_end = first(&[op::CAPABILITY, op::EXTENSION]);
    let entries_end =
        list.iter().rposition(|i| opcode(i) == op::ENTRY_POINT).ok_or("a module without entry point")? + 1;
    let mut out = module[..HEADER].to_vec();
    for (at, instruction) in list.iter().enumerate() {
        if at == capabilities_end {
            modes.iter().filter_map(|m| m.capability).for_each(|c| push(&mut out, op::CAPABILITY, &[c]));
        }
        if at == extensions_end {
            modes.iter().filter_map(|m| m.extension).for_each(|e| push(&mut out, op::EXTENSION, &literal(e)));
        }
        if at == entries_end {
            for (&entry, mode) in entries.iter().flat_map(|e| modes.iter().map(move |m| (e, m))) {
                push(&mut out, op::EXECUTION_MODE, &[&[entry, mode.mode], mode.operands].concat());
            }
        }
        out.extend_from_slice(instruction);
    }
    Ok(out)
}

fn push(out: &mut Vec<u32>, opcode: u32, operands: &[u32]) {
    out.push(((operands.len() as u32 + 1) << 16) | opcode);
    out.extend_from_slice(operands);
}

/// Words of a string: UTF-8, its end marked by at least one zero byte.
fn literal(text: &str) -> Vec<u32> {
    let mut words = vec![0u32; text.len() / 4 + 1];
    for (i, byte) in text.bytes().enumerate() {
        words[i / 4] |= u32::from(byte) << (8 * (i % 4));
    }
    words
}

/// Bytes of shared memory of a module with these specialisation constants (ids and values). Each variable
/// begins on the next multiple of 16, as no layout of theirs can need more.
pub fn shared_bytes(module: &[u32], spec: &[(u32, u32)]) -> Result<u64, String> {
    const WORKGROUP: u32 = 4; // storage class
    const SPEC_ID: u32 = 1; // decoration
    let mut found = Reader::default();
    let mut spec_ids = HashMap::new();
    let mut bytes = 0u64;
    for i in instructions(module)? {
        match opcode(i) {
            op::DECORATE if i[2] == SPEC_ID => {
                spec_ids.insert(i[1], i[3]);
            }
            op::SPEC_CONSTANT => {
                let set = spec_ids.get(&i[2]).and_then(|id| spec.iter().find(|(given, _)| given == id));
                found.values.insert(i[2], vec![set.map_or(i[3], |(_, value)| *value)]);
            }
            op::VARIABLE if i[3] == WORKGROUP => {
                let pointee = found.pointees.get(&i[1]).ok_or("a variable without its type")?;
                bytes = bytes.next_multiple_of(16) + found.size(*pointee)?;
            }
            _ => found.read(i)?,
        }
    }
    Ok(bytes)
}

/// Types and constants read so far.
#[derive(Default)]
struct Reader {
    /// Bytes of a type.
    sizes: HashMap<u32, u64>,
    pointees: HashMap<u32, u32>,
    /// A constant's words, or the words of a composite's members.
    values: HashMap<u32, Vec<u32>>,
}

impl Reader {
    fn size(&self, ty: u32) -> Result<u64, String> {
        self.sizes.get(&ty).copied().ok_or_else(|| format!("type %{ty} has no known size"))
    }

    fn value(&self, id: u32) -> Result<u32, String> {
        let known = self.values.get(&id).and_then(|v| v.first());
        known.copied().ok_or_else(|| format!("constant %{id} has no known value"))
    }

    fn read(&mut self, i: &[u32]) -> Result<(), String> {
        match opcode(i) {
            op::TYPE_BOOL => drop(self.sizes.insert(i[1], 4)),
            op::TYPE_INT | op::TYPE_FLOAT => drop(self.sizes.insert(i[1], u64::from(i[2] / 8))),
            op::TYPE_VECTOR => {
                // A vector of three is aligned like one of four.
                let size = self.size(i[2])? * u64::from(i[3] + i[3] % 2);
                self.sizes.insert(i[1], size);
            }
            op::TYPE_ARRAY => {
                if let (Ok(element), Ok(count)) = (self.size(i[2]), self.value(i[3])) {
                    self.sizes.insert(i[1], element * u64::from(count));
                }
            }
            op::TYPE_POINTER => drop(self.pointees.insert(i[1], i[3])),
            op::CONSTANT => drop(self.values.insert(i[2], i[3..].to_vec())),
            op::CONSTANT_COMPOSITE | op::SPEC_CONSTANT_COMPOSITE => {
                if let Ok(members) = i[3..].iter().map(|&m| self.value(m)).collect() {
                    self.values.insert(i[2], members);
                }
            }
            op::SPEC_CONSTANT_OP => {
                if let Some(value) = self.evaluate(i[3], &i[4..]) {
                    self.values.insert(i[2], vec![value]);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Evaluates an expression for an array's size; none for other expressions.
    fn evaluate(&self, operation: u32, operands: &[u32]) -> Option<u32> {
        if operation == op::COMPOSITE_EXTRACT {
            return self.values.get(&operands[0])?.get(operands[1] as usize).copied();
        }
        let [a, b] = operands else { return None };
        let (a, b) = (self.value(*a).ok()?, self.value(*b).ok()?);
        match operation {
            op::I_ADD => Some(a.wrapping_add(b)),
            op::I_SUB => Some(a.wrapping_sub(b)),
            op::I_MUL => Some(a.wrapping_mul(b)),
            op::U_DIV => a.checked_div(b),
            op::U_MOD => a.checked_rem(b),
            op::SHIFT_LEFT => a.checked_shl(b),
            op::SHIFT_RIGHT => a.checked_shr(b),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORKGROUP_SIZE: u32 = 0;

    /// A module of the instructions, each given as opcode and operands.
    fn module(list: &[(u32, &[u32])]) -> Vec<u32> {
        let mut words = vec![MAGIC, 0x0001_0500, 0, 99, 0];
        list.iter().for_each(|(opcode, operands)| push(&mut words, *opcode, operands));
        words
    }

    #[test]
    fn what_is_not_a_module_is_said_not_to_be_one() {
        assert!(words(&[]).is_err() && words(&[3, 2, 35, 7]).is_err() && words(&[0; 24]).is_err());
        let whole = module(&[(op::CAPABILITY, &[1])]);
        let bytes: Vec<u8> = whole.iter().flat_map(|w| w.to_le_bytes()).collect();
        assert_eq!(words(&bytes).unwrap(), whole);
        assert!(words(&bytes[..bytes.len() - 1]).is_err());
        // Cut short, and an instruction of no words.
        assert!(instructions(&whole[..whole.len() - 1]).is_err());
        assert!(instructions(&[&whole[..], &[op::CAPABILITY]].concat()).is_err());
        assert!(instructions(&whole[..3]).is_err());
        assert!(with_modes(&whole, &[]).is_err(), "no entry point");
    }

    #[test]
    fn shared_memory_is_measured_at_the_constants_that_are_set() {
        // uint[(workgroup size / 8) << 3], vec3[2], and a float that is not shared.
        let shared = module(&[
            (op::DECORATE, &[10, 1, WORKGROUP_SIZE]),
            (op::TYPE_INT, &[1, 32, 0]),
            (op::TYPE_FLOAT, &[2, 32]),
            (op::TYPE_VECTOR, &[3, 2, 3]),
            (op::SPEC_CONSTANT, &[1, 10, 64]),
            (op::CONSTANT, &[1, 11, 8]),
            (op::CONSTANT, &[1, 12, 3]),
            (op::CONSTANT, &[1, 13, 2]),
            (op::SPEC_CONSTANT_COMPOSITE, &[4, 14, 10, 11, 11]),
            (op::SPEC_CONSTANT_OP, &[1, 15, op::COMPOSITE_EXTRACT, 14, 0]),
            (op::SPEC_CONSTANT_OP, &[1, 16, op::U_DIV, 15, 11]),
            (op::SPEC_CONSTANT_OP, &[1, 17, op::SHIFT_LEFT, 16, 12]),
            (op::TYPE_ARRAY, &[5, 1, 17]),
            (op::TYPE_ARRAY, &[6, 3, 13]),
            (op::TYPE_POINTER, &[7, 4, 5]),
            (op::TYPE_POINTER, &[8, 4, 6]),
            (op::TYPE_POINTER, &[9, 6, 2]),
            (op::VARIABLE, &[7, 20, 4]),
            (op::VARIABLE, &[8, 21, 4]),
            (op::VARIABLE, &[9, 22, 6]),
        ]);
        assert_eq!(shared_bytes(&shared, &[]), Ok(4 * 64 + 2 * 16));
        // The second begins on the next multiple of 16.
        assert_eq!(shared_bytes(&shared, &[(WORKGROUP_SIZE, 8), (3, 5)]), Ok(4 * 8 + 2 * 16));
        assert_eq!(shared_bytes(&shared, &[(WORKGROUP_SIZE, 128)]), Ok(4 * 128 + 2 * 16));
        let unknown = module(&[(op::TYPE_POINTER, &[7, 4, 5]), (op::VARIABLE, &[7, 20, 4])]);
        assert!(shared_bytes(&unknown, &[]).is_err());
    }
}
