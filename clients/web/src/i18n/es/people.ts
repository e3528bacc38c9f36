// Spanish texts of people/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("es");

export const people: Texts["people"] = {
  text: "Quienes han jugado una partida puntuable en este servidor. Cada cual elige su nombre; una clave distingue los que son iguales.",
  ratedGames: (games) => plural(games, { one: "# partida puntuable", other: "# partidas puntuables" }),
  kinds: {
    label: "Quién",
    all: "Todos",
    human: "Personas",
    robot: "Robots",
    agent: "Agentes",
    model: "Modelos de lenguaje",
  },
  minGames: {
    label: "Con al menos",
    games: (games) => plural(games, { one: "# partida", other: "# partidas" }),
  },
  none: "Aquí todavía nadie ha jugado una partida puntuable.",
  noneOfThese: "Nadie cumple estos filtros. Elige menos partidas, o a todos.",
  toLobby: "Ve al vestíbulo y juega una",
  ratingHint: "Habilidad estimada, ± su incertidumbre (95 %)",
  order: "Orden según una estimación prudente: valoración menos dos desviaciones estándar.",
  truncated: (count) => `Solo se muestran los primeros ${count}.`,
  which: {
    title: "¿Qué partidas son puntuables?",
    text: "Una partida es puntuable automáticamente si",
    conditions: [
      "todos pueden encontrarla: no está sin listar ni es privada;",
      "se jugó hasta el final, o la interrumpieron participantes ausentes o su propietario, que jugaba en ella;",
      "el servidor repartió las cartas con una semilla propia: sin semilla fija, sin manos fijadas de antemano, ni variante de otra partida, ni partida con cartas reales o jugada en otro sitio;",
      "cada asiento tenía un participante distinto, por nombre, clave y tipo: ni dos veces el mismo agente integrado, ni la misma persona, ningún jugador grabado y nadie que jugara como robot.",
    ],
    losing:
      "Quien está ausente al final, tiene un sustituto o recibe una pista pierde contra todos los demás, sea cual sea su puesto. La partida sigue siendo puntuable.",
    toSee: "La lista de partidas de un participante dice por qué una partida no es puntuable.",
  },
  notRated: (why) => `no puntuable: ${why}`,
  forfeited: "puntúa como perdida contra todos",
  unrated: {
    added: "jugada en otro sitio",
    hidden: "no es pública",
    hinted: "alguien recibió pistas",
    notDealt: "cartas no repartidas con una semilla del servidor",
    recorded: "participó un jugador grabado",
    substituted: "un sustituto tomó decisiones",
    twice: "alguien jugó en dos asientos",
    wizard: "una persona jugó como robot",
  },
  fingerprint: (fingerprint) => `Clave del nombre: ${fingerprint}`,
  person: {
    unrated: "Todavía no hay partidas puntuables.",
    notListed: (lines) => `No está entre los primeros ${lines} de la clasificación.`,
    rated: (place) => `Puesto ${place} de la clasificación`,
    ratingRange: (from, to) => `La habilidad está entre ${from} y ${to} con una confianza del 95 %.`,
    games: "Partidas terminadas",
    wins: "Ganadas",
    meanPlace: "Puesto medio",
    sameName:
      "Un nombre puede tener varias claves: pueden ser partidas de varias personas que eligieron el mismo nombre.",
    played: "Partidas jugadas",
    none: "No hay registro de ninguna partida con este nombre que puedas ver.",
    noneOfNewest: "Ninguna de las partidas más recientes con este nombre tiene esta clave.",
    ofShown: (count) => plural(count, { one: "de # partida mostrada", other: "de # partidas mostradas" }),
    ofThese: (count) => plural(count, { one: "en esta partida", other: "en estas # partidas" }),
    columns: { date: "Cuándo", place: "Puesto", points: "Puntos", game: "Partida" },
    against: "Contra",
    aborted: "interrumpida",
    of: (room, date) => `${room}, ${date}`,
    toLeaderboard: "A la clasificación",
  },
};
