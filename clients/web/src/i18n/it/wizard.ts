// Italian texts of wizard/.

import type { Texts } from "../texts";

export const wizard: Texts["wizard"] = {
  title: "Console",
  what: "Giochi al posto di un robot. Fino alla fine della partita gli altri vedono un robot; la registrazione dice che ha giocato una persona.",
  lines: "Frasi da dire",
  firstLines: ["Ciao!", "Fammi pensare.", "Bella mossa!", "Questa volta passo.", "C’è mancato poco.", "Bravi tutti."],
  edit: "Modifica le frasi",
  editHint: (most) => `Una frase per riga, al massimo ${most}. Restano su questo dispositivo.`,
  keep: "Salva",
  expressions: "Espressioni",
  timing: "Tempi",
  noDecision: "Nessuna decisione in corso.",
  wait: (seconds) => `Agisci tra ${seconds}\u00a0s`,
  act: "Agisci ora",
  pace: "Tempo per pensare, secondi",
  paceHint: "Da–a, per esempio 2-6. Per ogni decisione si estrae un tempo.",
  paceFault: "Inserisci due numeri fino a 60, per esempio 2-6.",
  moves: "Mosse possibili",
  suggest: "Chiedi all’agente",
  suggested: "suggerita",
  noHints: "Questa stanza non dà suggerimenti.",
  asRobot: "Gioca come robot",
  asRobotHint: "Prendi un posto per robot: gli altri vedono un robot. Solo se chi ospita lo ha previsto.",
};
