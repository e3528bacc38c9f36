// Lists that the server gives page by page, asked for to their end. What a page holds is for the caller.

/** A page of a list. */
export interface Page<Item> {
  readonly items: readonly Item[];
  /** Token of the next page; empty on the last. */
  readonly nextPageToken: string;
}

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
