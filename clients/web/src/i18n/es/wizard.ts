// Spanish texts of wizard/.

import type { Texts } from "../texts";

export const wizard: Texts["wizard"] = {
  title: "Consola",
  what: "Juegas en el asiento de un robot. Hasta el final de la partida los demás ven un robot; el registro dice que ha jugado una persona.",
  lines: "Frases para decir",
  firstLines: [
    "¡Hola!",
    "Déjame pensar.",
    "¡Buena jugada!",
    "Esta vez paso.",
    "Ha faltado poco.",
    "Bien jugado, todos.",
  ],
  edit: "Editar las frases",
  editHint: (most) => `Una frase por línea, ${most} como máximo. Se guardan en este dispositivo.`,
  keep: "Guardar",
  expressions: "Reacciones",
  timing: "Tiempos",
  noDecision: "No hay ninguna decisión pendiente.",
  wait: (seconds) => `Actúa en ${seconds}\u00a0s`,
  act: "Actuar ahora",
  pace: "Tiempo para pensar, en segundos",
  paceHint: "De–a, por ejemplo 2-6. Para cada decisión se sortea un tiempo.",
  paceFault: "Escribe dos números hasta 60, por ejemplo 2-6.",
  moves: "Jugadas permitidas",
  suggest: "Preguntar al agente",
  suggested: "sugerida",
  noHints: "Esta sala no da pistas.",
  asRobot: "Jugar como robot",
  asRobotHint: "Ocupa un asiento para robots: los demás ven un robot. Solo si está previsto así.",
};
