//! Datagrams that the system dropped because the receive buffer of a socket was full.
//!
//! Linux counts them for each socket in the last column of `/proc/net/udp` and `/proc/net/udp6`. Other systems have no
//! such count.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

/// Time between two readings of the count.
const PERIOD: Duration = Duration::from_millis(500);

/// Count of the drops of a socket.
#[derive(Debug)]
pub(super) struct KernelDrops {
    /// Number of the socket in the tables; `None` if it is not known.
    inode: Option<String>,
    counted: u64,
    /// Time of the last reading.
    read: Option<Instant>,
}

impl KernelDrops {
    /// Starts at zero drops.
    pub(super) fn of(socket: &UdpSocket) -> Self {
        Self { inode: inode_of(socket), counted: 0, read: None }
    }

    /// Returns the number of drops since the last call, which is 0 more often than each [`PERIOD`] and where the
    /// system does not count.
    pub(super) fn new_drops(&mut self) -> u64 {
        let Some(inode) = self.inode.as_deref().filter(|_| self.read.is_none_or(|read| read.elapsed() >= PERIOD))
        else {
            return 0;
        };
        self.read = Some(Instant::now());
        let mut tables =
            ["/proc/net/udp", "/proc/net/udp6"].into_iter().filter_map(|path| std::fs::read_to_string(path).ok());
        let Some(total) = tables.find_map(|table| drops_in(&table, inode)) else { return 0 };
        let new = total.saturating_sub(self.counted);
        self.counted = self.counted.max(total);
        new
    }
}

#[cfg(target_os = "linux")]
fn inode_of(socket: &UdpSocket) -> Option<String> {
    use std::os::fd::AsRawFd as _;
    let link = std::fs::read_link(format!("/proc/self/fd/{}", socket.as_raw_fd())).ok()?;
    Some(link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned())
}

#[cfg(not(target_os = "linux"))]
fn inode_of(_socket: &UdpSocket) -> Option<String> {
    None
}

/// Returns the drops of a socket in a table: the columns are separated by spaces, number 10 is the inode and the last
/// one the drops.
fn drops_in(table: &str, inode: &str) -> Option<u64> {
    let rows = table.lines().skip(1).map(|row| row.split_whitespace().collect::<Vec<_>>());
    rows.into_iter().find(|row| row.get(9) == Some(&inode))?.last()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::drops_in;

    #[test]
    fn the_drops_of_one_socket_are_read() {
        // Number, addresses, state, queues, timer, retransmits, user, timeout, inode, references, pointer, drops.
        let row = |number: u32, inode: u32, drops: u32| {
            format!("{number}: 0100007F:3862 00000000:0000 07 0:300 00:0 0 1000 0 {inode} 2 0 {drops}\n")
        };
        let table = format!("sl local_address\n{}{}", row(1104, 83_716, 0), row(1105, 83_717, 94));
        assert_eq!(["83716", "83717", "837"].map(|inode| drops_in(&table, inode)), [Some(0), Some(94), None]);
        assert_eq!(drops_in("", "1"), None);
        assert_eq!(drops_in("head\n1 2\n\n", "2"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_buffer_is_counted() {
        use super::KernelDrops;
        use std::net::UdpSocket;

        let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let address = socket.local_addr().expect("an address");
        let sender = UdpSocket::bind("127.0.0.1:0").expect("a port");
        let count = |datagrams: usize| {
            let mut drops = KernelDrops::of(&socket);
            for _ in 0..datagrams {
                sender.send_to(&[0; 1000], address).expect("sends");
            }
            let first = drops.new_drops();
            drops.read = None;
            (first, drops.new_drops())
        };
        assert_eq!(count(3), (0, 0));
        // The default buffer holds a few hundred of these.
        let (first, again) = count(20_000);
        assert!(first > 10_000 && again == 0, "{first} {again}");
    }
}
