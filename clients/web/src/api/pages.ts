// Lists that the server gives page by page: asked for to their end, or as far as they are shown. What a page holds is for the caller.

import { useState } from "preact/hooks";
import type { Fault } from "./faults";
import { usePolled } from "./poll";

/** A page of a list. */
export interface Page<Item> {
  readonly items: readonly Item[];
  /** Token of the next page; empty on the last. */
  readonly nextPageToken: string;
}

/** The beginning of a list. */
export interface Beginning<Item> {
  readonly items: readonly Item[];
  /** Whether there is more of it. */
  readonly more: boolean;
}

/** A list of which so much is shown as the reader has asked for. */
export interface Shown<Item> {
  /** Null until it is known. */
  readonly list: Beginning<Item> | null;
  readonly fault: Fault | null;
  readonly showMore: () => void;
}

/** Largest page that the server gives of rooms, tournaments and records. */
const LARGEST_PAGE = 100;
/** Pages that are asked for at most at a time: a page may hold less than it was asked for. */
const MAX_PAGES = 50;

/** Everything on the pages that `ask` gives by token, in the server's order; of a longer list the first `most` pages. */
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

/** Asks for a page of so many with a token. */
export type AskPage<Item> = (page: { pageSize: number; pageToken: string }, signal: AbortSignal) => Promise<Page<Item>>;

/** The first `count` of a list, and whether there are more, for which one more is asked for. */
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

/** The beginning of a list, asked for again and again, and as many more at a time as at first. `key` says which list it is. */
export function useShown<Item>(ask: AskPage<Item>, atATime: number, everyMs: number, key: string): Shown<Item> {
  const [count, setCount] = useState(atATime);
  const { value, fault } = usePolled((signal) => firstOf(ask, count, signal), everyMs, `${key} ${count}`);
  return { list: value, fault, showMore: () => setCount((before) => before + atATime) };
}

/** How many there are, as far as it is known: "12+" if there are more than are shown. */
export function countWords(count: number, more: boolean): string {
  return more ? `${count}+` : String(count);
}
