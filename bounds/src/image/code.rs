//! The code of an image, instruction by instruction.

use std::collections::BTreeMap;

use anyhow::{Context, Result, anyhow};
use capstone::{
    arch::{
        ArchDetail, BuildsCapstone, BuildsCapstoneExtraMode, DetailsArchInsn,
        arm::{ArchExtraMode, ArchMode, ArmCC, ArmInsn, ArmOperand, ArmOperandType, ArmReg},
    },
    {Capstone, RegId},
};

/// What lies at an address, as the marks of the assembler say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Thumb,
    Data,
    Arm,
}

/// An instruction, with what is asked about it.
#[derive(Clone, Debug)]
pub(crate) struct Instruction {
    pub(crate) address: u32,
    pub(crate) size: u32,
    /// Of [`capstone::arch::arm::ArmInsn`].
    pub(crate) id: u32,
    pub(crate) mnemonic: String,
    /// As it reads, for messages.
    pub(crate) text: String,
    pub(crate) operands: Vec<ArmOperand>,
    /// Condition; `ARM_CC_AL` always.
    pub(crate) condition: ArmCC,
    pub(crate) writeback: bool,
    pub(crate) written: Vec<u16>,
}

/// Number of a register.
pub(crate) const SP: u16 = ArmReg::ARM_REG_SP as u16;
pub(crate) const LR: u16 = ArmReg::ARM_REG_LR as u16;
pub(crate) const PC: u16 = ArmReg::ARM_REG_PC as u16;

/// Instructions by address, and the data between them.
pub(crate) struct Code {
    instructions: BTreeMap<u32, Instruction>,
    marks: BTreeMap<u32, Kind>,
    bytes: Vec<(u32, Vec<u8>)>,
}

impl Code {
    /// Takes apart all that is marked as Thumb code; what lies between, tables and constants, is kept as it is.
    pub(crate) fn disassemble(sections: &[(u32, &[u8])], marks: &BTreeMap<u32, Kind>) -> Result<Self> {
        let engine = Capstone::new()
            .arm()
            .mode(ArchMode::Thumb)
            .extra_mode([ArchExtraMode::MClass].into_iter())
            .detail(true)
            .build()
            .map_err(|error| anyhow!("the disassembler does not start: {error}"))?;
        let mut instructions = BTreeMap::new();
        for (start, data) in sections {
            let end = start + data.len() as u32;
            let mut inside = marks.range(start..&end).peekable();
            while let Some((&from, &kind)) = inside.next() {
                let to = inside.peek().map_or(end, |(next, _)| **next);
                if kind != Kind::Thumb {
                    continue;
                }
                let code = data.get((from - start) as usize..(to - start) as usize).context("marks out of order")?;
                disassemble(&engine, code, from, &mut instructions)?;
            }
        }
        let bytes = sections.iter().map(|(address, data)| (*address, data.to_vec())).collect();
        Ok(Self { instructions, marks: marks.clone(), bytes })
    }

    pub(crate) fn at(&self, address: u32) -> Option<&Instruction> {
        self.instructions.get(&address)
    }

    /// The first instruction after the IT that the one at `address` belongs to.
    pub(crate) fn first_of_it(&self, address: u32) -> Option<&Instruction> {
        let before = self.instructions.range(..address).rev().take(4);
        let (_, it) = before.into_iter().find(|(_, before)| before.mnemonic.starts_with("it"))?;
        self.at(it.next())
    }

    /// Where the table of a jump lies: right behind it, or where the instruction before has made a register point to.
    pub(crate) fn base_of_table(&self, jump: &Instruction) -> Option<u32> {
        if jump.names_memory_at(PC) {
            return Some(jump.next());
        }
        let (_, before) = self.instructions.range(..jump.address).next_back()?;
        let is_behind_it = before.next() == jump.address && jump.names_memory_at(before.register(0)?);
        // `adr r5, #8`, which the disassembler may read as `addw r5, pc, #8`.
        let distance = match ArmInsn::from(before.id) {
            ArmInsn::ARM_INS_ADR => before.immediate(1)?,
            ArmInsn::ARM_INS_ADD | ArmInsn::ARM_INS_ADDW if before.register(1) == Some(PC) => before.immediate(2)?,
            _ => return None,
        };
        if !is_behind_it {
            return None;
        }
        u32::try_from(i64::from((before.address + 4) & !3) + distance).ok()
    }

    /// The bytes from `address` to where code begins again.
    pub(crate) fn table_at(&self, address: u32) -> Option<&[u8]> {
        let before = self.marks.range(..=address).next_back()?;
        if *before.1 != Kind::Data {
            return None;
        }
        let (start, data) =
            self.bytes.iter().find(|(start, data)| (*start..*start + data.len() as u32).contains(&address))?;
        let end = self.marks.range(address + 1..).next().map_or(start + data.len() as u32, |(next, _)| *next);
        data.get((address - start) as usize..(end.min(start + data.len() as u32) - start) as usize)
    }
}

/// The number that argument `nth` of the only call in a piece of code is: what last goes into its register, if that is a number.
pub(crate) fn argument(code: &[&Instruction], nth: u16) -> Option<u32> {
    let register = ArmReg::ARM_REG_R0 as u16 + nth;
    let is_call = |one: &&Instruction| one.mnemonic == "bl";
    // Without one it ends in a jump to a function; with more there is no telling which is meant.
    let call = code.iter().position(is_call).unwrap_or(code.len().checked_sub(1)?);
    if code.iter().skip(call + 1).any(is_call) {
        return None;
    }
    // Whatever else names the register may write it.
    let names = |one: &&&Instruction| (0..one.operands.len()).any(|i| one.register(i) == Some(register));
    let last = code[..call].iter().rev().find(names)?;
    let is_move = ["mov", "movs", "mov.w", "movw"].contains(&last.mnemonic.as_str());
    let number = last.immediate(1).filter(|_| is_move && !last.is_conditional() && last.register(0) == Some(register));
    u32::try_from(number?).ok()
}

fn disassemble(
    engine: &Capstone,
    code: &[u8],
    address: u32,
    instructions: &mut BTreeMap<u32, Instruction>,
) -> Result<()> {
    // All of it in one go: the conditions of an IT instruction reach into those that follow.
    let found = engine.disasm_all(code, u64::from(address)).map_err(|error| anyhow!("{address:#x}: {error}"))?;
    let mut next = address;
    for one in found.iter() {
        let detail = engine.insn_detail(one).map_err(|error| anyhow!("{:#x}: {error}", one.address()))?;
        let ArchDetail::ArmDetail(arm) = detail.arch_detail();
        let mnemonic = one.mnemonic().unwrap_or_default();
        let instruction = Instruction {
            address: one.address() as u32,
            size: one.bytes().len() as u32,
            id: one.id().0,
            mnemonic: mnemonic.to_owned(),
            text: format!("{mnemonic} {}", one.op_str().unwrap_or_default()),
            operands: arm.operands().collect(),
            condition: arm.cc(),
            writeback: arm.writeback(),
            written: detail.regs_write().iter().map(|register| register.0).collect(),
        };
        next = instruction.address + instruction.size;
        instructions.insert(instruction.address, instruction);
    }
    let missing = address + code.len() as u32 - next;
    // A half word at the end fills up to the next alignment.
    if missing > 2 {
        return Err(anyhow!("{next:#x}: an instruction that the disassembler does not know"));
    }
    Ok(())
}

impl Instruction {
    pub(crate) fn next(&self) -> u32 {
        self.address + self.size
    }

    pub(crate) fn is_conditional(&self) -> bool {
        !matches!(self.condition, ArmCC::ARM_CC_AL | ArmCC::ARM_CC_INVALID)
    }

    pub(crate) fn writes(&self, register: u16) -> bool {
        self.written.contains(&register)
    }

    /// The register that operand `i` is.
    pub(crate) fn register(&self, i: usize) -> Option<u16> {
        match self.operands.get(i)?.op_type {
            ArmOperandType::Reg(RegId(register)) => Some(register),
            _ => None,
        }
    }

    /// The number that operand `i` is.
    pub(crate) fn immediate(&self, i: usize) -> Option<i64> {
        match self.operands.get(i)?.op_type {
            ArmOperandType::Imm(value) => Some(i64::from(value)),
            _ => None,
        }
    }

    /// Whether an operand names memory at what `register` points to.
    pub(crate) fn names_memory_at(&self, register: u16) -> bool {
        self.operands.iter().any(|operand| match operand.op_type {
            ArmOperandType::Mem(memory) => memory.base().0 == register,
            _ => false,
        })
    }

    /// Whether the instruction runs when the first one after its IT does.
    pub(crate) fn is_then(&self, first: Option<&Self>) -> bool {
        first.is_none_or(|first| first.condition == self.condition)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number that the third argument of a call in some Thumb code is.
    fn third(code: &[u16]) -> Option<u32> {
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let marks = BTreeMap::from([(0x100, Kind::Thumb)]);
        let code = Code::disassemble(&[(0x100, &bytes)], &marks).unwrap();
        argument(&code.instructions.values().collect::<Vec<_>>(), 2)
    }

    #[test]
    fn an_argument_is_what_last_went_into_its_register() {
        const MOVS_R2_64: u16 = 0x2240;
        const MOVS_R2_4: u16 = 0x2204;
        const MOV_R2_R4: u16 = 0x4622;
        const LDR_R2_FROM_SP: u16 = 0x9a00;
        const B: u16 = 0xe7fe;
        const BL: [u16; 2] = [0xf000, 0xf800];
        let code = |before: &[u16], behind: &[u16]| [before, &BL, behind].concat();
        assert_eq!(third(&code(&[MOVS_R2_4, MOVS_R2_64], &[])), Some(64));
        // What comes behind the call is of another.
        assert_eq!(third(&code(&[MOVS_R2_64], &[MOVS_R2_4, B])), Some(64));
        assert_eq!(third(&[MOVS_R2_64, B]), Some(64));
        assert_eq!(third(&code(&[MOVS_R2_64, MOV_R2_R4], &[])), None);
        assert_eq!(third(&code(&[MOVS_R2_64, LDR_R2_FROM_SP], &[])), None);
        assert_eq!(third(&code(&[], &[MOVS_R2_64])), None);
        assert_eq!(third(&code(&[MOVS_R2_64], &BL)), None);
        // If equal, or not: `it eq; moveq r2, #4`.
        assert_eq!(third(&code(&[0xbf08, MOVS_R2_4], &[])), None);
    }
}
