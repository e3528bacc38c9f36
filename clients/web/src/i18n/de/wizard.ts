// German texts of wizard/.

import type { Texts } from "../texts";

export const wizard: Texts["wizard"] = {
  title: "Konsole",
  what: "Du spielst auf dem Platz eines Roboters. Bis zum Ende der Partie sehen alle anderen einen Roboter; die Aufzeichnung sagt, dass eine Person gespielt hat.",
  lines: "Sätze zum Sagen",
  firstLines: [
    "Hallo!",
    "Lass mich überlegen.",
    "Guter Zug!",
    "Diesmal passe ich.",
    "Das war knapp.",
    "Gut gespielt, alle zusammen.",
  ],
  edit: "Sätze bearbeiten",
  editHint: (most) => `Ein Satz pro Zeile, höchstens ${most}. Sie bleiben auf diesem Gerät.`,
  keep: "Speichern",
  expressions: "Reaktionen",
  timing: "Zeiten",
  noDecision: "Gerade ist nichts zu entscheiden.",
  wait: (seconds) => `Handle in ${seconds}\u00a0s`,
  act: "Handle jetzt",
  pace: "Bedenkzeit in Sekunden",
  paceHint: "Von–bis, zum Beispiel 2-6. Für jede Entscheidung wird eine Zeit ausgelost.",
  paceFault: "Gib zwei Zahlen bis 60 ein, zum Beispiel 2-6.",
  moves: "Erlaubte Züge",
  suggest: "Den Agenten fragen",
  suggested: "vorgeschlagen",
  noHints: "Dieser Raum gibt keine Tipps.",
  asRobot: "Als Roboter spielen",
  asRobotHint: "Nimm einen Platz für Roboter: Alle anderen sehen einen Roboter. Nur, wenn es so vorgesehen ist.",
};
