// Italian texts of replay/.

import type { Texts } from "../en";

export const replay: Texts["replay"] = {
  title: "Rivedere",
  controls: "Rivedere",
  first: "All’inizio",
  before: "Un momento indietro",
  play: "Avvia",
  pause: "Pausa",
  after: "Un momento avanti",
  last: "Alla fine",
  moment: "Momento della partita",
  decisionOf: (decision, all) => `${decision} di ${all} decisioni prese`,
  shift: "Shift",
  speed: "Velocità",
  eyes: "Carte in vista",
  allHands: "tutte le mani",
  as: (name) => `come ${name}`,
  asSpectator: "come il pubblico",
  possible: "Che cosa si poteva fare",
  answered: (name, answer) => `${name}: ${answer}`,
  seconds: (seconds) => `${seconds.toFixed(1).replace(".", ",")} s`,
  estimate: (value) => `stima propria ${value.toFixed(2).replace(".", ",")}`,
  noTable: "Questa decisione non è un turno: la tabella non ne dice nulla.",
  empty: "Questa registrazione non contiene eventi.",
};
