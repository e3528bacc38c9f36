// Writes files into a ZIP archive without compression (APPNOTE.TXT 6.3, sections 4.3.7, 4.3.12 and
// 4.3.14 to 4.3.16), names in UTF-8. There may be any number of files, of less than 4 GiB in all.

const LOCAL = 0x04034b50;
const CENTRAL = 0x02014b50;
const END = 0x06054b50;
const LARGE_END = 0x06064b50;
const LARGE_END_LOCATOR = 0x07064b50;
const VERSION = 20;
const LARGE_VERSION = 45;
/** The number of files in the end of an archive that has this many or more. */
const MANY = 0xffff;
/** Names are UTF-8. */
const UTF8 = 0x0800;
/** 1 January 1980, the earliest date. */
const DATE = 0x0021;

/** An archive with these files. */
export function zipped(files: ReadonlyMap<string, readonly Uint8Array[]>): Blob {
  const parts: BlobPart[] = [];
  const central: Uint8Array<ArrayBuffer>[] = [];
  let offset = 0;
  for (const [path, data] of files) {
    const name = new TextEncoder().encode(path);
    const size = data.reduce((sum, { length }) => sum + length, 0);
    const common = [VERSION, UTF8, 0, 0, DATE];
    const check: [number, number][] = [
      [4, crc32(data)],
      [4, size],
      [4, size],
      [2, name.length],
      [2, 0],
    ];
    const words = common.map((value): [number, number] => [2, value]);
    const header = bytesOf([[4, LOCAL], ...words, ...check], name);
    parts.push(header, ...data.map((part) => new Uint8Array(part)));
    const rest: [number, number][] = [
      [2, 0],
      [2, 0],
      [2, 0],
      [4, 0],
      [4, offset],
    ];
    central.push(bytesOf([[4, CENTRAL], [2, VERSION], ...words, ...check, ...rest], name));
    offset += header.length + size;
  }
  const size = central.reduce((sum, { length }) => sum + length, 0);
  const count = central.length;
  const largeEnd: [number, number][] = [
    [4, LARGE_END],
    [8, 44],
    [2, LARGE_VERSION],
    [2, LARGE_VERSION],
    [4, 0],
    [4, 0],
    [8, count],
    [8, count],
    [8, size],
    [8, offset],
    [4, LARGE_END_LOCATOR],
    [4, 0],
    [8, offset + size],
    [4, 1],
  ];
  const end: [number, number][] = [
    [4, END],
    [2, 0],
    [2, 0],
    [2, Math.min(count, MANY)],
    [2, Math.min(count, MANY)],
    [4, size],
    [4, offset],
    [2, 0],
  ];
  const ends = bytesOf(count < MANY ? end : [...largeEnd, ...end]);
  return new Blob([...parts, ...central, ends], { type: "application/zip" });
}

/** Numbers of these lengths in bytes, little-endian, and what follows. */
function bytesOf(numbers: readonly [number, number][], after = new Uint8Array()): Uint8Array<ArrayBuffer> {
  const length = numbers.reduce((sum, [bytes]) => sum + bytes, 0);
  const written = new Uint8Array(length + after.length);
  const view = new DataView(written.buffer);
  let at = 0;
  for (const [bytes, value] of numbers) {
    if (bytes === 2) view.setUint16(at, value, true);
    else if (bytes === 4) view.setUint32(at, value, true);
    else view.setBigUint64(at, BigInt(value), true);
    at += bytes;
  }
  written.set(after, at);
  return written;
}

const TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let rest = byte;
  for (let bit = 0; bit < 8; bit += 1) rest = rest & 1 ? 0xedb88320 ^ (rest >>> 1) : rest >>> 1;
  return rest;
});

function crc32(parts: readonly Uint8Array[]): number {
  let crc = 0xffffffff;
  for (const part of parts) for (const byte of part) crc = (TABLE[(crc ^ byte) & 0xff] ?? 0) ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}
