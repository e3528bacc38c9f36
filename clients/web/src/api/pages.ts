// Paginated lists of the server: read to the end, or as far as they are shown.

import { useState } from "preact/hooks";
import type { Fault } from "./faults";
import { usePolled } from "./poll";

/** A page of a list. */
export interface Page<Item> {
  readonly items: readonly Item[];
  /** Token of the next page; empty on the last. */
  readonly nextPageToken: string;
}

/** The first items of a list. */
export interface Beginning<Item> {
  readonly items: readonly Item[];
  /** Whether the list continues. */
  readonly more: boolean;
}

/** The part of a list that is shown. */
export interface Shown<Item> {
  /** Null until the first response. */
  readonly list: Beginning<Item> | null;
  readonly fault: Fault | null;
  readonly showMore: () => void;
}

/** The server's largest page of rooms, tournaments and records. */
export const LARGEST_PAGE = 100;
/** Most pages requested at a time. A page may be shorter than requested. */
const MAX_PAGES = 50;

/** All items of a list, in the server's order, from at most `most` pages. */
export async function allPages<Item>(ask: (pageToken: string) => Promise<Page<Item>>, most: number): Promise<Item[]> {
  const found: Item[] = [];
  let pageToken = "";
  for (let page = 0; page < most; page += 1) {
    const { items, nextPageToken } = await ask(pageToken);
    found.push(...items);
    pageToken = nextPageToken;
    if (pageToken === "") break;
  }
  return found;
}

/** Requests one page of a list. */
export type AskPage<Item> = (page: { pageSize: number; pageToken: string }, signal: AbortSignal) => Promise<Page<Item>>;

/** The first `count` items, and whether there are more. Requests one item more to find out. */
export async function firstOf<Item>(ask: AskPage<Item>, count: number, signal: AbortSignal): Promise<Beginning<Item>> {
  const found: Item[] = [];
  let pageToken = "";
  for (let page = 0; page < MAX_PAGES && found.length <= count; page += 1) {
    const pageSize = Math.min(LARGEST_PAGE, count + 1 - found.length);
    const { items, nextPageToken } = await ask({ pageSize, pageToken }, signal);
    found.push(...items);
    pageToken = nextPageToken;
    if (pageToken === "") break;
  }
  return { items: found.slice(0, count), more: found.length > count || pageToken !== "" };
}

/** The first items of a list, polled, with more of them on request. `key` identifies the list. */
export function useShown<Item>(ask: AskPage<Item>, atATime: number, everyMs: number, key: string): Shown<Item> {
  const [count, setCount] = useState(atATime);
  const { value, fault } = usePolled((signal) => firstOf(ask, count, signal), everyMs, `${key} ${count}`);
  return { list: value, fault, showMore: () => setCount((before) => before + atATime) };
}

/** A count in words: "12+" if there are more than are shown. */
export function countWords(count: number, more: boolean): string {
  return more ? `${count}+` : String(count);
}
