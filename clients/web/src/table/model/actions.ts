// Actions and their indices, which depend on the number of faces F alone, and masks of legal
// actions. The server decides which actions are legal.

/** The meaning of an action. */
export type Move =
  | { readonly kind: "play"; readonly face: number; readonly quantity: number; readonly jokers: number }
  | { readonly kind: "loneJoker" }
  | { readonly kind: "pass" }
  | { readonly kind: "give"; readonly face: number }
  | { readonly kind: "giveJoker" }
  | { readonly kind: "decline" }
  | { readonly kind: "declare" };

/** T: the number of actions of a turn, including passing (200 with the default deck). */
export function turnActions(faces: number): number {
  return (3 * faces * (faces + 1)) / 2 + 2;
}

/** The index of a move. */
export function actionOf(move: Move, faces: number): number {
  const turns = turnActions(faces);
  switch (move.kind) {
    case "play":
      return 3 * ((move.face * (move.face - 1)) / 2 + move.quantity - 1) + move.jokers;
    case "loneJoker":
      return turns - 2;
    case "pass":
      return turns - 1;
    case "give":
      return turns + move.face - 1;
    case "giveJoker":
      return turns + faces;
    case "decline":
      return turns + faces + 1;
    case "declare":
      return turns + faces + 2;
  }
}

/** The meaning of an index; undefined for one beyond the last. */
export function moveOf(action: number, faces: number): Move | undefined {
  const turns = turnActions(faces);
  if (action === turns - 2) return { kind: "loneJoker" };
  if (action === turns - 1) return { kind: "pass" };
  if (action >= turns) {
    const after = action - turns;
    if (after < faces) return { kind: "give", face: after + 1 };
    return ([{ kind: "giveJoker" }, { kind: "decline" }, { kind: "declare" }] as const)[after - faces];
  }
  let face = 1;
  while (3 * ((face * (face + 1)) / 2) <= action) face += 1;
  const within = action - 3 * ((face * (face - 1)) / 2);
  return { kind: "play", face, quantity: Math.floor(within / 3) + 1, jokers: within % 3 };
}

/** The legal actions of a mask: bit i%8 of byte i/8 is action i. */
export function legalActions(mask: Uint8Array): number[] {
  return Array.from({ length: mask.length * 8 }, (_, action) => action).filter(
    (action) => (mask[action >> 3] ?? 0) & (1 << (action & 7)),
  );
}

/** A mask of actions, in the form of a decision request. */
export function maskOf(actions: readonly number[], faces: number): Uint8Array {
  const mask = new Uint8Array(Math.ceil((turnActions(faces) + faces + 3) / 8));
  for (const action of actions) mask[action >> 3] = (mask[action >> 3] ?? 0) | (1 << (action & 7));
  return mask;
}
