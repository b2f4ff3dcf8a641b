//! What the measurement ran on.

use std::fs;

/// Processor, cores, kernel and load.
pub fn description() -> String {
    let read = |path| fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model = cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let model = model.map_or("unknown processor", |(_, name)| name);
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let kernel = read("/proc/sys/kernel/osrelease");
    let hypervisor = if cpuinfo.contains(" hypervisor") { ", a virtual machine" } else { "" };
    format!("{cores} cores of {model}{hypervisor}, Linux {}; load average {}", kernel.trim(), load())
}

/// How many processes wanted to run in the last minute, on average.
pub fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().unwrap_or("unknown").to_owned()
}
