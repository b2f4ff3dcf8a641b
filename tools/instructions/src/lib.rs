//! A plugin of QEMU's code generator that counts the instructions of the emulated processor: all of them, and those of
//! each block of code. The counts are in a file that may be read at any time, for QEMU maps it.
//!
//! `-plugin libpuente_instructions.so,counts=FILE`. The file is a row of 64-bit numbers, as this machine has them: the
//! first is the sum, then one for each half-word of the code memory, for the block that starts there.
//!
//! With `spans=FILE,begins=A,ends=B,next=C` it counts spans too, from each time that the function at address A is called
//! to the next call of that at B. This file has three numbers for each of the first 64 stretches between two calls of
//! that at C: how many spans, their instructions, and those of the longest. Addresses are decimal.
#![deny(missing_docs)]

mod spans;

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::fs::OpenOptions;
use std::io;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::mm::{MapFlags, ProtFlags, mmap};

/// Bytes of code memory that are told apart, from address 0 on; more than the firmware takes.
const CODE: usize = 1 << 20;
/// One number for the sum, and one for each place where an instruction may start.
const COUNTS: usize = 1 + CODE / 2;

/// The interface that this is made for: QEMU refuses what is older or newer than what it supports. The functions used
/// here are the same in all of them.
#[allow(non_upper_case_globals, reason = "QEMU looks for this name")]
// SAFETY: no other part of the plugin or of what it is linked with has a symbol of this name.
#[unsafe(no_mangle)]
pub static qemu_plugin_version: c_int = match option_env!("QEMU_PLUGIN_VERSION") {
    Some(text) => match text.as_bytes() {
        [digit @ b'0'..=b'9'] => (*digit - b'0') as c_int,
        _ => panic!("QEMU_PLUGIN_VERSION is one digit"),
    },
    None => 1,
};

/// A block of code that QEMU is about to translate.
#[repr(C)]
pub struct Block {
    _private: [u8; 0],
}

type Translated = extern "C" fn(id: u64, block: *mut Block);
type Executed = extern "C" fn(processor: c_uint, data: *mut c_void);
/// `QEMU_PLUGIN_CB_NO_REGS`: the callback looks at no register.
const NO_REGISTERS: c_int = 0;

// As qemu-plugin.h declares them. QEMU itself has them when it loads the plugin.
unsafe extern "C" {
    fn qemu_plugin_register_vcpu_tb_trans_cb(id: u64, callback: Translated);
    fn qemu_plugin_register_vcpu_tb_exec_cb(
        block: *mut Block,
        callback: Executed,
        flags: c_int,
        data: *mut c_void,
    );
    fn qemu_plugin_tb_n_insns(block: *const Block) -> usize;
    fn qemu_plugin_tb_vaddr(block: *const Block) -> u64;
}

static FILE: OnceLock<&'static [AtomicU64]> = OnceLock::new();

/// QEMU calls this once, when it has loaded the plugin. Anything but 0 ends it.
///
/// # Safety
/// `arguments` are `count` texts that end with a zero byte.
// SAFETY: as for the version.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _about: *const c_void,
    count: c_int,
    arguments: *const *const c_char,
) -> c_int {
    let option = |name: &str| {
        (0..usize::try_from(count).unwrap_or_default()).find_map(|index| {
            // SAFETY: what the caller promises.
            let argument = unsafe { CStr::from_ptr(*arguments.add(index)) };
            argument.to_str().ok()?.strip_prefix(name)?.strip_prefix('=')
        })
    };
    let Some(file) = option("counts") else {
        eprintln!("instructions: the option counts=FILE is missing");
        return 1;
    };
    if let Err(error) = spans::start(option) {
        eprintln!("instructions: {error}");
        return 1;
    }
    match map(file, COUNTS) {
        Ok(counts) => {
            let _ = FILE.set(counts);
            // SAFETY: `id` is this plugin's, and the callback has the type that the interface asks for.
            unsafe { qemu_plugin_register_vcpu_tb_trans_cb(id, translated) };
            0
        }
        Err(error) => {
            eprintln!("instructions: {file}: {error}");
            1
        }
    }
}

/// The file in memory, for as long as this process lives.
fn map(path: &str, numbers: usize) -> io::Result<&'static [AtomicU64]> {
    let size = numbers * size_of::<AtomicU64>();
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(path)?;
    file.set_len(size as u64)?;
    let access = ProtFlags::READ | ProtFlags::WRITE;
    // SAFETY: a new mapping at an address of the system's choice overlaps nothing. It is never taken away, is as long as
    // the slice and aligned to a page. Who else has the file open only reads it, and every number is a count.
    let counts = unsafe {
        let start = mmap(std::ptr::null_mut(), size, access, MapFlags::SHARED, &file, 0)?;
        std::slice::from_raw_parts(start.cast(), numbers)
    };
    Ok(counts)
}

/// QEMU has a new block of code: it is to be counted each time that it runs.
extern "C" fn translated(_id: u64, block: *mut Block) {
    // SAFETY: the block is QEMU's, and valid until this returns. What is handed over is no pointer, but two numbers.
    unsafe {
        let instructions = qemu_plugin_tb_n_insns(block);
        let place = qemu_plugin_tb_vaddr(block) as usize;
        let data = place << INSTRUCTIONS | instructions;
        qemu_plugin_register_vcpu_tb_exec_cb(block, executed, NO_REGISTERS, data as *mut c_void);
    }
}

/// Bits for the number of instructions of a block: QEMU takes 512 at most.
const INSTRUCTIONS: u32 = 16;

/// A block runs.
extern "C" fn executed(_processor: c_uint, data: *mut c_void) {
    let (place, instructions) = (data as usize >> INSTRUCTIONS, data as u64 & ((1 << INSTRUCTIONS) - 1));
    let Some(counts) = FILE.get() else { return };
    if let Some(sum) = counts.first() {
        spans::reached(place, sum.load(Ordering::Relaxed));
    }
    for index in [0, 1 + place / 2] {
        if let Some(count) = counts.get(index) {
            // There is one processor, so that nobody adds at the same time.
            count.store(count.load(Ordering::Relaxed) + instructions, Ordering::Relaxed);
        }
    }
}
