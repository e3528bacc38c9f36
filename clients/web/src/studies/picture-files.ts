// Files of pictures that a study can have; the server checks them again.

/** What file fields offer. */
export const PICTURES = "image/png,image/jpeg,image/gif,image/webp";
/** Most pictures of a study. */
export const MAX_PICTURES = 16;
/** The largest file of a picture, bytes. */
export const MAX_PICTURE_BYTES = 262_144;
/** Most bytes of all pictures of a study. */
export const MAX_BYTES_IN_ALL = 524_288;

/** A picture of a study. */
export interface PictureFile {
  readonly name: string;
  readonly data: Uint8Array<ArrayBuffer>;
}

/** The media type of a picture, by how its file begins; empty if a study cannot have it. */
export function formatOf(file: Uint8Array): string {
  const begins = (...bytes: number[]) => bytes.every((byte, index) => file[index] === byte);
  if (begins(0x89, 0x50, 0x4e, 0x47)) return "image/png";
  if (begins(0xff, 0xd8, 0xff)) return "image/jpeg";
  if (begins(0x47, 0x49, 0x46, 0x38)) return "image/gif";
  const isWebP = [0x57, 0x45, 0x42, 0x50].every((byte, index) => file[8 + index] === byte);
  return begins(0x52, 0x49, 0x46, 0x46) && isWebP ? "image/webp" : "";
}

/** A file under a name that texts can have. One that is too large is not read. */
export async function pictureOf(file: File): Promise<PictureFile> {
  const name = file.name
    .toLowerCase()
    .replaceAll(/[^a-z0-9_.-]/g, "-")
    .slice(-64)
    .replace(/^\.+/, "");
  const read = file.size <= MAX_PICTURE_BYTES ? await file.arrayBuffer() : new ArrayBuffer(MAX_PICTURE_BYTES + 1);
  return { name, data: new Uint8Array(read) };
}

/** The pictures with one more; it gets another name if a different one has its name. */
export function withPicture(pictures: readonly PictureFile[], added: PictureFile): readonly PictureFile[] {
  const isSame = ({ data }: PictureFile) =>
    data.length === added.data.length && data.every((byte, index) => byte === added.data[index]);
  const named = (name: string) => pictures.find((one) => one.name === name);
  let { name } = added;
  for (let number = 2; ; number += 1) {
    const other = named(name);
    if (!other) return [...pictures, { ...added, name }];
    if (isSame(other)) return pictures;
    name = `${number}-${added.name}`.slice(0, 64);
  }
}

/** Whether a study can have these pictures. */
export function areAllowed(pictures: readonly PictureFile[]): boolean {
  const isAllowed = ({ data }: PictureFile) => data.length <= MAX_PICTURE_BYTES && formatOf(data) !== "";
  const bytes = pictures.reduce((sum, { data }) => sum + data.length, 0);
  return pictures.length <= MAX_PICTURES && bytes <= MAX_BYTES_IN_ALL && pictures.every(isAllowed);
}
