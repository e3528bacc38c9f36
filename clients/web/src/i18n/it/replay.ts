// Italian texts of replay/.

import type { Texts } from "../en";

export const replay: Texts["replay"] = {
  title: "Replay",
  controls: "Replay",
  first: "All’inizio",
  before: "Un passo indietro",
  play: "Avvia",
  pause: "Pausa",
  after: "Un passo avanti",
  last: "Alla fine",
  moment: "Posizione nella partita",
  decisionOf: (decision, all) => `${decision} di ${all} decisioni prese`,
  shift: "Shift",
  speed: "Velocità",
  perspective: "Carte visibili",
  allHands: "tutte le mani",
  as: (name) => `come ${name}`,
  asSpectator: "come spettatore",
  possible: "Giocate possibili",
  answered: (name, answer) => `${name}: ${answer}`,
  seconds: (seconds) => `${seconds.toFixed(1).replace(".", ",")} s`,
  estimate: (value) => `stima ${value.toFixed(2).replace(".", ",")}`,
  noTable: "Questa decisione non è un turno e non ha una tabella.",
  empty: "Questa registrazione non contiene eventi.",
};
