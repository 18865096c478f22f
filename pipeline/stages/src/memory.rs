//! Available memory. Work whose estimate exceeds it is refused, because a failed allocation ends the process, and with it the notebook
//! that uses the Python module.

use crate::error::Error;
use std::fs;
use std::path::Path;

/// Refuses work that needs more memory than this process can get; `what` names it.
///
/// # Errors
/// [`Error::Retry`], as more memory may be free later.
pub fn check(what: &str, needed: u64) -> Result<(), Error> {
    let gib = |bytes: u64| bytes as f64 / f64::from(1u32 << 30);
    match available() {
        Some(available) if needed > available => Err(Error::Retry(format!(
            "{what} needs about {:.2} GiB of memory, but only {:.2} GiB is available; make it smaller, or free memory",
            gib(needed),
            gib(available)
        ))),
        _ => Ok(()),
    }
}

/// Bytes that this process can still get; `None` if the system does not say.
fn available() -> Option<u64> {
    let read = |path: &str| fs::read_to_string(path).ok();
    let groups = read("/proc/self/cgroup").unwrap_or_default();
    let limits: Vec<String> = groups.lines().flat_map(group_limits).filter_map(|path| read(&path)).collect();
    least(&read("/proc/meminfo")?, &read("/proc/self/status")?, &read("/proc/self/limits")?, &limits)
}

/// Files with the memory limits of a control group and of those that contain it, which limit it too, from a line such as `0::/job/step` or
/// `4:memory:/job`. In a container the group may be visible as the root only.
fn group_limits(line: &str) -> Vec<String> {
    let mut fields = line.splitn(3, ':').skip(1);
    let (Some(controllers), Some(group)) = (fields.next(), fields.next()) else { return Vec::new() };
    let (root, file) = match controllers {
        "" => ("/sys/fs/cgroup", "memory.max"),
        "memory" => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
        _ => return Vec::new(),
    };
    let groups = Path::new(group).ancestors().map(|group| group.to_string_lossy());
    groups.map(|group| format!("{root}{}/{file}", group.trim_end_matches('/'))).collect()
}

/// The least of what the machine has available, with swap, and what the limits of the process leave, from the texts of `/proc` and of the
/// limits of its control groups. What other processes of the group hold is not counted, because most of it may be file cache.
fn least(meminfo: &str, status: &str, limits: &str, groups: &[String]) -> Option<u64> {
    let number = |text: &str, name: &str| -> Option<u64> {
        let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
        rest.split_whitespace().next()?.parse().ok()
    };
    let kib = |text: &str, name: &str| number(text, name).map(|kib| kib << 10);
    let (reserved, resident) = (kib(status, "VmSize:")?, kib(status, "VmRSS:")?);
    let address_space = number(limits, "Max address space").map(|limit| limit.saturating_sub(reserved));
    let group = groups.iter().filter_map(|limit| limit.trim().parse::<u64>().ok()).min();
    let group = group.map(|limit| limit.saturating_sub(resident));
    let swap = kib(meminfo, "SwapFree:").unwrap_or(0);
    let machine = kib(meminfo, "MemAvailable:").map(|memory| memory.saturating_add(swap));
    [machine, address_space, group].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_the_narrowest_limit_counts() {
        let meminfo = "MemTotal:       24683656 kB\nMemFree:          100 kB\nMemAvailable:   3000 kB\n";
        let status = "Name:\tpython3\nVmSize:\t    1000 kB\nVmRSS:\t     200 kB\n";
        let limits = |soft: &str| {
            format!(
                "Max processes             5         5         processes\nMax address space         {soft} unlimited bytes\n"
            )
        };
        let of = |soft: &str, groups: &[&str]| {
            let groups: Vec<String> = groups.iter().map(|&text| text.to_owned()).collect();
            least(meminfo, status, &limits(soft), &groups).unwrap()
        };
        let swap = format!("{meminfo}SwapTotal:  900 kB\nSwapFree:   500 kB\n");
        assert_eq!(least(&swap, status, &limits("unlimited"), &[]), Some(3500 << 10));
        assert_eq!(of("unlimited", &[]), 3000 << 10);
        assert_eq!(of("2048000", &[]), 1000 << 10);
        assert_eq!(of("1000", &[]), 0);
        assert_eq!(of("2048000", &["max\n", "9223372036854771712\n"]), 1000 << 10);
        assert_eq!(of("unlimited", &["1024000\n", "max\n"]), 800 << 10);
    }

    #[test]
    fn val_limits_of_control_groups() {
        assert_eq!(group_limits("0::/job"), ["/sys/fs/cgroup/job/memory.max", "/sys/fs/cgroup/memory.max"]);
        let nested =
            ["/job/step/task", "/job/step", "/job", ""].map(|group| format!("/sys/fs/cgroup{group}/memory.max"));
        assert_eq!(group_limits("0::/job/step/task"), nested);
        assert_eq!(group_limits("0::/"), ["/sys/fs/cgroup/memory.max"]);
        let old = ["/sys/fs/cgroup/memory/job/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
        assert_eq!(group_limits("4:memory:/job"), old);
        assert!(group_limits("3:cpuset:/").is_empty() && group_limits("").is_empty());
    }

    #[test]
    fn val_more_than_the_machine_has_is_refused() {
        assert!(check("the terrain", 1 << 10).is_ok());
        let refused = check("the terrain", u64::MAX).unwrap_err();
        assert!(matches!(&refused, Error::Retry(why) if why.starts_with("the terrain needs about ")), "{refused}");
    }
}
