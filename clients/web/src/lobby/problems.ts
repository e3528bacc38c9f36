// Problems with typed numbers, found before submitting so that all are marked at once: the server
// reports one field at a time. The messages are in GameFields.tsx, the bounds are those of the
// protocol.

/** Smallest and largest number that a field can hold. */
export type Bounds = readonly [from: number, to: number];

/** Why a number is invalid. */
export type NumberProblem =
  | "notANumber"
  | "notWhole"
  | "notPoints"
  | "rising"
  | { readonly bounds: Bounds }
  | { readonly places: number };

/** The largest uint32. */
export const LARGEST = 4_294_967_295;

/** The problem with an integer; undefined if it is valid. */
export function wholeProblem(typed: string, bounds: Bounds): NumberProblem | undefined {
  const number = typed.trim();
  if (!/^[+-]?\d+([.,]\d+)?$/.test(number)) return "notANumber";
  if (!/^[+-]?\d+$/.test(number)) return "notWhole";
  return within(Number(number), bounds);
}

/** The problem with a time in seconds; undefined if it is valid. */
export function secondsProblem(typed: string, bounds: Bounds): NumberProblem | undefined {
  const number = typed.trim().replace(",", ".");
  return /^[+-]?\d+(\.\d+)?$/.test(number) ? within(Number(number), bounds) : "notANumber";
}

/** The problem with the points by place; undefined if they are valid or empty. */
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
