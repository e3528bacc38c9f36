// What can be wrong with a number that was typed, found before a form is sent, so that all of it is marked at once: the server names one field
// at a time. The words are in GameFields.tsx. The bounds are those of the protocol (rules.proto, room.proto, tournament.proto).

/** Smallest and largest number that a field can hold. */
export type Bounds = readonly [from: number, to: number];

/** Why a number cannot be sent. */
export type NumberProblem =
  | "notANumber"
  | "notWhole"
  | "notPoints"
  | "rising"
  | { readonly bounds: Bounds }
  | { readonly places: number };

/** Largest number that the protocol can carry. */
export const LARGEST = 4_294_967_295;

/** What is wrong with a whole number; undefined if nothing is. */
export function wholeProblem(typed: string, bounds: Bounds): NumberProblem | undefined {
  const number = typed.trim();
  if (!/^[+-]?\d+([.,]\d+)?$/.test(number)) return "notANumber";
  if (!/^[+-]?\d+$/.test(number)) return "notWhole";
  return within(Number(number), bounds);
}

/** What is wrong with a time in seconds; undefined if nothing is. */
export function secondsProblem(typed: string, bounds: Bounds): NumberProblem | undefined {
  const number = typed.trim().replace(",", ".");
  return /^[+-]?\d+(\.\d+)?$/.test(number) ? within(Number(number), bounds) : "notANumber";
}

/** What is wrong with the points of so many places; undefined if nothing is, as with none. */
export function pointsProblem(typed: string, places: number): NumberProblem | undefined {
  if (typed.trim() === "") return undefined;
  const points = typed.trim().split(/[\s,;]+/);
  if (!points.every((point) => /^\d{1,9}$/.test(point))) return "notPoints";
  if (points.length !== places) return { places };
  const rising = points.some((point, index) => index > 0 && Number(point) > Number(points[index - 1]));
  return rising || Number(points[0]) === 0 ? "rising" : undefined;
}

function within(number: number, bounds: Bounds): NumberProblem | undefined {
  return number >= bounds[0] && number <= bounds[1] ? undefined : { bounds };
}
