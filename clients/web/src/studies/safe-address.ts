/** An address of another site, or empty: a link must not run a script. */
export function safeAddress(address: string): string {
  return ["https:", "http:"].includes(URL.parse(address)?.protocol ?? "") ? address : "";
}
