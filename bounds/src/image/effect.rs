//! What an instruction does to the stack pointer.

use std::collections::BTreeMap;

use capstone::arch::arm::{ArmInsn, ArmOperandType, ArmReg};

use super::code::{Instruction, PC, SP};

/// How far the stack pointer lies below where it was when the function was entered, and which registers hold such a place too.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Stack {
    /// Bytes; at most, where it was aligned.
    pub(super) depth: i64,
    places: BTreeMap<u16, i64>,
}

/// An instruction that leaves nobody knowing where the stack ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct UnknownFrame;

impl Stack {
    /// The stack after `instruction`, which is no branch.
    pub(super) fn after(&self, instruction: &Instruction) -> Result<Self, UnknownFrame> {
        let mut next = self.clone();
        next.places.retain(|register, _| !instruction.writes(*register));
        if let Some(bytes) = moved(instruction) {
            next.depth += bytes;
        } else if let Some(to) = instruction.register(0).filter(|to| instruction.writes(*to)) {
            match (self.place(instruction), to) {
                (Some(depth), SP) => next.depth = depth,
                (Some(depth), to) => _ = next.places.insert(to, depth),
                (None, SP) => return Err(UnknownFrame),
                (None, _) if instruction.writes(SP) => return Err(UnknownFrame),
                (None, _) => {}
            }
        } else if instruction.writes(SP) {
            return Err(UnknownFrame);
        }
        Ok(next)
    }

    /// The stack after a call, which keeps the stack pointer and the registers that are not its own.
    pub(super) fn after_call(&self) -> Self {
        let kept: core::ops::RangeInclusive<u16> = ArmReg::ARM_REG_R4 as u16..=ArmReg::ARM_REG_R11 as u16;
        let places = self.places.iter().filter(|&(register, _)| kept.contains(register));
        Self { depth: self.depth, places: places.map(|(register, depth)| (*register, *depth)).collect() }
    }

    /// What is known on both of two ways to the same instruction; `None` if they do not agree on the depth.
    pub(super) fn meet(&self, other: &Self) -> Option<Self> {
        let mut places = self.places.clone();
        places.retain(|register, depth| other.places.get(register) == Some(depth));
        (self.depth == other.depth).then_some(Self { depth: self.depth, places })
    }

    /// The place that the first operand is set to, if it is one on the stack.
    fn place(&self, instruction: &Instruction) -> Option<i64> {
        let of = |register: u16| if register == SP { Some(self.depth) } else { self.places.get(&register).copied() };
        let last = instruction.operands.len().checked_sub(1)?;
        // `add sp, #8` has two operands, `add sp, r7, #8` three.
        let base = of(instruction.register(1).or_else(|| instruction.register(0))?);
        match ArmInsn::from(instruction.id) {
            ArmInsn::ARM_INS_MOV => of(instruction.register(1)?),
            ArmInsn::ARM_INS_ADD | ArmInsn::ARM_INS_ADDW => Some(base? - instruction.immediate(last)?),
            ArmInsn::ARM_INS_SUB | ArmInsn::ARM_INS_SUBW => Some(base? + instruction.immediate(last)?),
            // Down to a multiple of a power of two: words are whole before.
            ArmInsn::ARM_INS_BFC if instruction.immediate(1)? == 0 => {
                Some(of(instruction.register(0)?)? + (1 << instruction.immediate(2)?) - 4)
            }
            ArmInsn::ARM_INS_BIC => {
                let mask = instruction.immediate(last)?;
                ((mask + 1) as u64).is_power_of_two().then_some(base? + (mask + 1 - 4).max(0))
            }
            _ => None,
        }
    }
}

/// Bytes by which pushing and popping moves the stack down; `None` if the instruction does neither.
fn moved(instruction: &Instruction) -> Option<i64> {
    let bytes =
        |from: usize| instruction.operands.iter().skip(from).map(|operand| register_bytes(&operand.op_type)).sum();
    let onto_stack = instruction.register(0) == Some(SP) && instruction.writeback;
    match ArmInsn::from(instruction.id) {
        ArmInsn::ARM_INS_PUSH | ArmInsn::ARM_INS_VPUSH => Some(bytes(0)),
        ArmInsn::ARM_INS_POP | ArmInsn::ARM_INS_VPOP => Some(-bytes(0)),
        ArmInsn::ARM_INS_STMDB | ArmInsn::ARM_INS_VSTMDB if onto_stack => Some(bytes(1)),
        ArmInsn::ARM_INS_LDM | ArmInsn::ARM_INS_VLDMIA if onto_stack => Some(-bytes(1)),
        // Stored or loaded with the pointer moved before or after: by the number behind the last `#`.
        _ if instruction.writeback && instruction.names_memory_at(SP) => {
            let (_, number) = instruction.text.rsplit_once('#')?;
            number_of(number.trim_end_matches(['!', ']'])).map(|by| -by)
        }
        _ => None,
    }
}

/// Reads `-0x10` and `16`.
fn number_of(text: &str) -> Option<i64> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let value = match digits.strip_prefix("0x") {
        Some(hex) => i64::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    value.ok().map(|value| sign * value)
}

fn register_bytes(operand: &ArmOperandType) -> i64 {
    let ArmOperandType::Reg(register) = operand else { return 0 };
    let within = |first: u32, last: u32| (first as u16..=last as u16).contains(&register.0);
    match () {
        () if within(ArmReg::ARM_REG_D0, ArmReg::ARM_REG_D31) => 8,
        () if within(ArmReg::ARM_REG_Q0, ArmReg::ARM_REG_Q15) => 16,
        () => 4,
    }
}

/// Whether the instruction is the end of a function: it loads or goes to the address that the caller left.
pub(super) fn returns(instruction: &Instruction) -> bool {
    match ArmInsn::from(instruction.id) {
        ArmInsn::ARM_INS_BX => instruction.register(0) == Some(super::code::LR),
        ArmInsn::ARM_INS_POP => (0..instruction.operands.len()).any(|i| instruction.register(i) == Some(PC)),
        ArmInsn::ARM_INS_LDM => {
            instruction.register(0) == Some(SP)
                && (1..instruction.operands.len()).any(|i| instruction.register(i) == Some(PC))
        }
        ArmInsn::ARM_INS_LDR => instruction.register(0) == Some(PC) && instruction.names_memory_at(SP),
        _ => false,
    }
}
