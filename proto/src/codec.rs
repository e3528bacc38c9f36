//! The codec of calls: protocol buffers, as in tonic. A large message takes milliseconds to decode or
//! encode, for which its thread leaves the other tasks of the runtime to another thread.

use std::num::NonZero;
use std::sync::LazyLock;
use std::thread::available_parallelism;

use prost::Message;
use prost::bytes::Buf as _;
use tokio::runtime::{Handle, RuntimeFlavor};
use tokio::sync::Semaphore;
use tokio::task::block_in_place;
use tonic::Status;
use tonic::codec::{BufferSettings, Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic_prost::{ProstCodec, ProstDecoder, ProstEncoder};

/// From this size on, bytes, a message is worth the change of threads.
pub const LARGE: usize = 64 * 1024;

/// Permits for large messages at a time: half of the cores stay free for everything else.
static PERMITS: LazyLock<Semaphore> = LazyLock::new(|| {
    let cores = available_parallelism().map_or(1, NonZero::get);
    Semaphore::new((cores / 2).max(1))
});

/// Encodes the messages `T` and decodes the messages `U` of a call.
#[derive(Debug, Clone)]
pub struct CallCodec<T, U>(ProstCodec<T, U>);

impl<T, U> Default for CallCodec<T, U> {
    fn default() -> Self {
        Self(ProstCodec::default())
    }
}

impl<T, U> Codec for CallCodec<T, U>
where
    T: Message + Send + 'static,
    U: Message + Default + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = CallEncoder<T>;
    type Decoder = CallDecoder<U>;

    fn encoder(&mut self) -> Self::Encoder {
        CallEncoder(self.0.encoder())
    }

    fn decoder(&mut self) -> Self::Decoder {
        CallDecoder(self.0.decoder())
    }
}

/// Encodes the messages of a call.
#[derive(Debug, Clone)]
pub struct CallEncoder<T>(ProstEncoder<T>);

impl<T: Message> Encoder for CallEncoder<T> {
    type Item = T;
    type Error = Status;

    fn encode(&mut self, message: T, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        beside_tasks(message.encoded_len(), || self.0.encode(message, buffer))
    }

    fn buffer_settings(&self) -> BufferSettings {
        self.0.buffer_settings()
    }
}

/// Decodes the messages of a call.
#[derive(Debug, Clone)]
pub struct CallDecoder<U>(ProstDecoder<U>);

impl<U: Message + Default> Decoder for CallDecoder<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        beside_tasks(buffer.remaining(), || self.0.decode(buffer))
    }

    fn buffer_settings(&self) -> BufferSettings {
        self.0.buffer_settings()
    }
}

/// Does work on a message of this many bytes. If it is large and the runtime has several threads, this
/// one leaves its other tasks to another meanwhile, and waits for one of a few permits.
pub fn beside_tasks<T>(bytes: usize, work: impl FnOnce() -> T) -> T {
    let runtime = match bytes >= LARGE {
        true => Handle::try_current().ok(),
        false => None,
    };
    let has_several = |it: &Handle| it.runtime_flavor() == RuntimeFlavor::MultiThread;
    match runtime.filter(has_several) {
        Some(runtime) => block_in_place(|| {
            let permit = runtime.block_on(PERMITS.acquire());
            let _permit = permit.expect("the semaphore is never closed");
            work()
        }),
        None => work(),
    }
}
