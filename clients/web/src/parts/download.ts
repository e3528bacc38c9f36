// Saves a file that the page has made on this device.

/** Saves a file in the browser's folder for downloads. */
export function download(content: BlobPart, name: string, type: string): void {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  link.click();
  // Some browsers read the file only after the click.
  setTimeout(() => URL.revokeObjectURL(address), KEPT_MS);
}

/** How long a file can be read, milliseconds. */
const KEPT_MS = 60_000;

/** A name as the base of a file's name: letters and digits of any script, joined by hyphens. */
export function fileName(name: string): string {
  return (
    name
      .normalize("NFC")
      .replace(/[^\p{L}\p{M}\p{N}]+/gu, "-")
      .replace(/^-|-$/g, "") || "file"
  );
}
