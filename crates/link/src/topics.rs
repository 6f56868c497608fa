//! Topics between processes on one machine, for a teacher who observes a running simulator and
//! sends markers back.
//!
//! # Theory
//! Publish and subscribe through shared memory (iceoryx2): no daemon, no socket. A publisher never
//! waits: a slow, stopped or dead subscriber loses old messages without affecting others.
//!
//! ```text
//!   simulator ──"header", "tick", "event", "state"──> watcher
//!             <──"teacher"───────────────────────────
//! ```
//!
//! # Practice
//! Messages are the protobuf bytes of the recordings, at most [`MAX_MESSAGE_BYTES`], a header 64
//! KiB, a state 32 MiB; publishing one costs a few µs, a state some ms. Publish from the recorder's
//! thread, not from a haptic tick. [`Subscriber::newest`] has no age: a dead publisher looks like a
//! silent one, so compare the sequence numbers with the clock. Leftovers of a killed process are
//! removed when the next one joins. Signal handlers are not changed.
//!
//! # Sources
//! <https://iceoryx.io>.
//!
//! # When not to use it
//! Inside a process: [`crate::cell`] and [`crate::queue`] are ten times faster. Between machines:
//! use iceoryx2's tunnel.

use crate::protobuf::{decode, encode};
use crate::wire::{CollisionRecord, EventRecord, SessionHeader, SolverRecord, StateRecord, TeacherRecord, TickRecord};
use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::subscriber::Subscriber as SubscriberPort;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{
    AllocationStrategy, LogLevel, Node, NodeBuilder, ServiceName, SignalHandlingMode, ipc_threadsafe, set_log_level,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::marker::PhantomData;
use std::time::SystemTime;

/// Longest message, bytes.
pub const MAX_MESSAGE_BYTES: usize = 4096;
/// Longest header, bytes: a drawn flap has hundreds of points.
const MAX_HEADER_BYTES: usize = 65536;
/// Longest state, bytes: four million changed places of a skull.
const MAX_STATE_BYTES: usize = 32 << 20;
/// Most simulators and watchers that share a topic.
const MAX_MEMBERS: usize = 16;

type Service = ipc_threadsafe::Service;

/// A record that can be published.
pub trait Topic: sealed::Sealed {
    /// Name of its topic within a session.
    const TOPIC: &'static str;
    /// Its longest message, bytes.
    const MAX_BYTES: usize;
    /// Messages that a subscriber may lag before it loses the oldest.
    const BUFFER: usize;
}

mod sealed {
    pub trait Sealed: crate::protobuf::Fields {}
}

macro_rules! topics {
    ($($record:ty = $topic:literal, $bytes:expr, $buffer:expr;)*) => {
        $(
            impl sealed::Sealed for $record {}
            impl Topic for $record {
                const TOPIC: &'static str = $topic;
                const MAX_BYTES: usize = $bytes;
                const BUFFER: usize = $buffer;
            }
        )*
    };
}

topics!(
    TickRecord = "tick", MAX_MESSAGE_BYTES, 256;
    CollisionRecord = "collision", MAX_MESSAGE_BYTES, 256;
    SolverRecord = "solver", MAX_MESSAGE_BYTES, 256;
    EventRecord = "event", MAX_MESSAGE_BYTES, 256;
    TeacherRecord = "teacher", MAX_MESSAGE_BYTES, 256;
    SessionHeader = "header", MAX_HEADER_BYTES, 1;
    StateRecord = "state", MAX_STATE_BYTES, 1;
);

/// A topic could not be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopicError {
    /// The session's name is invalid.
    #[error("{name:?} is no name for a session; give one of 1 to 100 letters, digits and hyphens")]
    Name {
        /// The name.
        name: String,
    },
    /// Shared memory could not be set up.
    #[error("cannot {what} in session {session:?}: {reason}; see whether /dev/shm is writable and has room")]
    SharedMemory {
        /// The failed operation.
        what: &'static str,
        /// The session.
        session: String,
        /// The middleware's message.
        reason: String,
    },
    /// A message is too long.
    #[error("a message of {bytes} bytes is too long for topic {topic}; the limit is {limit}")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The topic's limit, bytes.
        limit: usize,
        /// The topic.
        topic: &'static str,
    },
}

/// A process's membership in a session.
pub struct Session {
    node: Node<Service>,
    name: String,
}

/// Publishes one kind of record.
pub struct Publisher<T> {
    port: Port<Service, [u8], u64>,
    bytes: Vec<u8>,
    session: String,
    record: PhantomData<fn(T)>,
}

/// Receives one kind of record.
pub struct Subscriber<T> {
    port: SubscriberPort<Service, [u8], u64>,
    garbled: u64,
    record: PhantomData<fn() -> T>,
}

impl Session {
    /// Joins a session by name, and removes leftovers of dead processes.
    pub fn join(name: &str) -> Result<Self, TopicError> {
        let sound = (1..=100).contains(&name.len()) && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-');
        if !sound {
            return Err(TopicError::Name { name: name.to_owned() });
        }
        set_log_level(LogLevel::Error);
        let node = NodeBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| failed("join", name, &error))?;
        Ok(Self { node, name: name.to_owned() })
    }

    /// Creates a publisher of `T`.
    pub fn publisher<T: Topic>(&self) -> Result<Publisher<T>, TopicError> {
        let topic = self.topic::<T>()?;
        let port = topic.publisher_builder().initial_max_slice_len(T::MAX_BYTES.min(MAX_HEADER_BYTES));
        // Only a state grows: no longer message of another topic is sent.
        let port = port.allocation_strategy(AllocationStrategy::PowerOfTwo).create();
        let port = port.map_err(|error| failed("publish", &self.name, &error))?;
        Ok(Publisher { port, bytes: Vec::with_capacity(512), session: self.name.clone(), record: PhantomData })
    }

    /// Creates a subscriber to `T`. It gets the newest message from before when its publisher next
    /// sends or greets.
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, TopicError> {
        let port = self.topic::<T>()?.subscriber_builder().create();
        let port = port.map_err(|error| failed("subscribe", &self.name, &error))?;
        Ok(Subscriber { port, garbled: 0, record: PhantomData })
    }

    fn topic<T: Topic>(&self) -> Result<PortFactory<Service, [u8], u64>, TopicError> {
        let name = format!("trepan/{}/{}", self.name, T::TOPIC);
        let name = ServiceName::new(&name).map_err(|_| TopicError::Name { name: self.name.clone() })?;
        self.node
            .service_builder(&name)
            .publish_subscribe::<[u8]>()
            .user_header::<u64>()
            .enable_safe_overflow(true)
            .history_size(1)
            .subscriber_max_buffer_size(T::BUFFER)
            .max_publishers(MAX_MEMBERS)
            .max_subscribers(MAX_MEMBERS)
            .max_nodes(2 * MAX_MEMBERS)
            .open_or_create()
            .map_err(|error| failed("open a topic", &self.name, &error))
    }
}

impl<T: Topic> Publisher<T> {
    /// Publishes a record to all subscribers. Never waits.
    pub fn send(&mut self, record: &T) -> Result<(), TopicError> {
        self.bytes.clear();
        encode(record, &mut self.bytes);
        if self.bytes.len() > T::MAX_BYTES {
            return Err(TopicError::TooLong { bytes: self.bytes.len(), limit: T::MAX_BYTES, topic: T::TOPIC });
        }
        let failed = |error: &dyn std::fmt::Debug| failed("publish", &self.session, error);
        let mut sample = self.port.loan_slice_uninit(self.bytes.len()).map_err(|error| failed(&error))?;
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        *sample.user_header_mut() = now.map_or(0, |since| since.as_nanos() as u64);
        sample.write_from_slice(&self.bytes).send().map_err(|error| failed(&error))?;
        Ok(())
    }

    /// Sends the newest message to subscribers that joined since. Call it now and then where
    /// messages are rare.
    pub fn greet(&self) -> Result<(), TopicError> {
        self.port.update_connections().map_err(|error| failed("greet", &self.session, &error))
    }
}

impl<T: Topic> Subscriber<T> {
    /// Receives a publisher's oldest message; several publishers are emptied one after the other.
    pub fn receive(&mut self) -> Result<Option<T>, TopicError> {
        Ok(self.receive_sent()?.map(|(_, record)| record))
    }

    /// Receives a message with the time at which it was sent, ns since 1970.
    fn receive_sent(&mut self) -> Result<Option<(u64, T)>, TopicError> {
        while let Some(sample) = self.port.receive().map_err(|error| failed("receive", T::TOPIC, &error))? {
            match decode(&sample) {
                Some(record) => return Ok(Some((*sample.user_header(), record))),
                None => self.garbled += 1,
            }
        }
        Ok(None)
    }

    /// Receives the message that was sent last, by any publisher, if one arrived since the last
    /// call.
    pub fn newest(&mut self) -> Result<Option<T>, TopicError> {
        let mut newest: Option<(u64, T)> = None;
        for _ in 0..MAX_MEMBERS * (T::BUFFER + 1) {
            match self.receive_sent()? {
                Some(sent) if newest.as_ref().is_none_or(|newest| sent.0 >= newest.0) => newest = Some(sent),
                Some(_) => {}
                None => break,
            }
        }
        Ok(newest.map(|(_, record)| record))
    }

    /// Number of invalid messages, for example from another version.
    pub fn garbled(&self) -> u64 {
        self.garbled
    }
}

fn failed(what: &'static str, session: &str, reason: &dyn std::fmt::Debug) -> TopicError {
    TopicError::SharedMemory { what, session: session.to_owned(), reason: format!("{reason:?}") }
}
