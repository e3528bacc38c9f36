/** An address of another site, or empty: a link must not run a script. */
export function safeAddress(address: string): string {
  try {
    return ["https:", "http:"].includes(new URL(address).protocol) ? address : "";
  } catch {
    return "";
  }
}
