// The keys of cards, as in the terminal (`chefshat play`). What they do is in view/deciding.ts.

/** The keys of the faces from 1: digits, then letters without another meaning. */
const FACE_KEYS = "1234567890abcfg";
/** Picks a joker alone; `ADD_JOKER` adds one to the picked cards. */
const JOKERS_KEY = "J";
export const ADD_JOKER = "j";

/** The key of a face; that of the jokers for undefined. */
export function keyOf(face: number | undefined): string | undefined {
  return face === undefined ? JOKERS_KEY : FACE_KEYS[face - 1];
}

/** The cards that a key names: a face, or jokers; undefined for any other key. */
export function cardsOf(key: string): { readonly face: number | undefined } | undefined {
  if (key === JOKERS_KEY) return { face: undefined };
  const index = key.length === 1 ? FACE_KEYS.indexOf(key) : -1;
  return index < 0 ? undefined : { face: index + 1 };
}
