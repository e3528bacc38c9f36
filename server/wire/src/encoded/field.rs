//! Writes fields of messages directly. Most numbers and lengths are small and take one byte.

use prost::encoding::{WireType, encode_key, encode_varint};

/// Writes a number, omitted when it is zero.
pub(super) fn put_number(out: &mut Vec<u8>, field: u32, number: u64) {
    if number != 0 {
        put_key(out, field, WireType::Varint, number);
    }
}

/// Writes the first `length` of some bytes.
pub(super) fn put_bytes(
    out: &mut Vec<u8>,
    field: u32,
    length: usize,
    bytes: impl Iterator<Item = u8>,
) {
    let count = u64::try_from(length).expect("memory holds it");
    put_key(out, field, WireType::LengthDelimited, count);
    let start = out.len();
    out.resize(start + length, 0);
    for (place, byte) in out[start..].iter_mut().zip(bytes) {
        *place = byte;
    }
}

/// Writes a message of less than 16 KiB with the fields that `content` writes.
pub(super) fn put_message(out: &mut Vec<u8>, field: u32, content: impl FnOnce(&mut Vec<u8>)) {
    put_key(out, field, WireType::LengthDelimited, 0);
    let start = out.len();
    content(out);
    let length = out.len() - start;
    assert!(length < 1 << 14, "a message of {length} bytes");
    // The length is known only now; it nearly always fits the byte reserved for it.
    let low = u8::try_from(length & 0x7f).expect("seven bits");
    if length < 0x80 {
        out[start - 1] = low;
    } else {
        out[start - 1] = low | 0x80;
        let high = u8::try_from(length >> 7).expect("seven bits");
        out.insert(start, high);
    }
}

/// Writes the key of a field and the number or length after it.
fn put_key(out: &mut Vec<u8>, field: u32, wire_type: WireType, number: u64) {
    match u8::try_from(number) {
        Ok(small @ 0..0x80) if field < 16 => {
            let key = u8::try_from(field << 3).expect("below 128") | wire_type as u8;
            out.extend_from_slice(&[key, small]);
        }
        _ => {
            encode_key(field, wire_type, out);
            encode_varint(number, out);
        }
    }
}
