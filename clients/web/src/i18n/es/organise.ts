// Spanish texts of creating and running a tournament, in tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("es");

export const organise: Texts["organise"] = {
  title: "Crear un torneo",
  link: "Crear un torneo…",
  name: "Nombre del torneo",
  namePlaceholder: "Copa de primavera",
  format: "Quién juega con quién",
  formats: {
    knockout:
      "Mesas de cuatro, por sorteo. Los dos primeros de cada mesa pasan de ronda, hasta una final de cuatro. Corto, con un vencedor claro.",
    roundRobin:
      "Todos se encuentran con todos, tanto como el número lo permite. La clasificación más justa, y el mayor número de partidas.",
    swiss:
      "Unas pocas rondas en las que se encuentran participantes con puntuaciones parecidas. No se elimina a nadie y bastan menos partidas.",
  },
  players: "Jugadores por mesa",
  playersKnockout: "Una eliminatoria siempre tiene mesas de cuatro.",
  rounds: "Rondas",
  roundsHint: "Vacío: tantas como sugiera el formato",
  gamesPerPairing: "Partidas por mesa y ronda",
  gamesPerPairingHint: "Los asientos rotan de uno en uno de partida a partida.",
  gamesPerPairingRotated: "Aquí, el número de repartos; cada uno se juega una vez por asiento.",
  who: "Quién participa",
  builtIn: "Agentes integrados",
  builtInHint: "Cuántos de cada uno; 0 para ninguno",
  builtInSum: (count) => plural(count, { one: "# agente integrado", other: "# agentes integrados" }),
  kinds: "Quién puede inscribirse con el código",
  kind: { people: "Personas", agents: "Agentes", robots: "Robots", models: "Modelos de lenguaje" },
  maxParticipants: "Número máximo de participantes",
  maxParticipantsHint: "De 2 a 1024, con los agentes integrados",
  physicalTables: "Mesas con cartas reales",
  physicalTablesHint: "Para quienes juegan con cartas reales; los añades antes del comienzo. 0 para ninguna",
  filler: "Agente de relleno",
  fillerHint: "Completa el cuadro o una mesa, y juega por los participantes que no se presentan.",
  when: "Cuándo empieza",
  start: {
    label: "Empieza",
    byHand: "cuando yo lo inicie",
    joined: "automáticamente, con un número de participantes",
    time: "automáticamente, a una hora",
    timeHint: "Con quienes se hayan inscrito para entonces, si son al menos dos.",
    byHandHint: "Con un botón de su página que solo muestra este dispositivo.",
    joinedHint: "En cuanto se inscriban tantos.",
  },
  startWhen: "Participantes",
  startWhenHint: "Con los agentes integrados",
  startAt: "Fecha y hora",
  noShow: "Segundos que una partida espera a los ausentes",
  noShowHint: "De 1 a 86400. Después, la partida se vuelve a llamar más tarde.",
  maxCalls: "Llamadas por partida",
  maxCallsHint: "En la última llamada se juega sin los ausentes.",
  otherClocks: "Tiempos distintos para agentes, robots y modelos de lenguaje",
  otherClocksHint: "A los programas les bastan segundos, las personas necesitan más.",
  agentSeconds: "Segundos por decisión de un agente",
  robotSeconds: "Segundos por decisión de un robot",
  modelSeconds: "Segundos por decisión de un modelo de lenguaje",
  more: "Repartos, reglas, errores y espectadores",
  deals: "Cómo se reparten las cartas",
  dealWords: {
    independent: {
      name: "Un reparto nuevo en cada partida",
      hint: "Para personas y agentes.",
    },
    same: {
      name: "El mismo reparto en todas las mesas de una ronda",
      hint: "La suerte con las cartas se compensa. No se permiten espectadores, y las repeticiones se abren cuando termina la ronda.",
    },
    rotated: {
      name: "Cada reparto una vez por asiento",
      hint: "Para agentes integrados y agentes que se declaran sin estado. Las personas no pueden inscribirse.",
    },
  },
  maxParallel: "Número máximo de partidas a la vez",
  notWatched: "Con estos repartos no se permiten espectadores: las cartas de una mesa revelarían las de otra.",
  experiment: "Para un experimento reproducible",
  drawSeed: "Semilla de los emparejamientos",
  drawSeedHint: "64 cifras hexadecimales; vacío para una semilla al azar",
  dealSeed: "Semilla de los repartos",
  dealSeedHint: "Quien la conoce, conoce las cartas; las partidas no son puntuables.",
  problems: {
    nameMissing: "Escribe un nombre.",
    tooMany: "Pueden participar 1024 como máximo.",
    nobody: "Permite que se inscriba al menos un tipo de participantes.",
    notASeed: "Escribe 64 cifras hexadecimales.",
    startPassed: "Escribe una hora que no haya pasado.",
  },
  submit: "Crear el torneo",
  own: {
    title: "Organizas este torneo",
    text: "Solo este dispositivo puede iniciarlo, cambiarlo y cerrarlo.",
    invite: "Invitar a participantes",
    joined: (count) => plural(count, { one: "# inscripción.", other: "# inscripciones." }),
    startsAt: (count) => `Empieza automáticamente con ${count} inscripciones.`,
    start: "Iniciar el torneo",
    startText: "Sortea las mesas y llama las primeras partidas. Después ya no puede inscribirse nadie.",
    filledUp: (field, filler, more) =>
      plural(more, {
        one: `Se añade # agente «${filler}» para llegar a ${field}.`,
        other: `Se añaden # agentes «${filler}» para llegar a ${field}.`,
      }),
    atTable: {
      title: "Añadir participantes en una mesa con cartas reales",
      text: "Nadie se conecta por ellos. Quien atiende la mesa anota lo que hacen.",
      name: "Nombre",
      kind: "Quién es",
      submit: "Añadir",
    },
    tables: {
      title: "Partidas con cartas reales",
      text: "Atiende la mesa en este dispositivo. Su página tiene también el enlace para otro dispositivo.",
    },
    pause: {
      pause: "Pausar",
      resume: "Reanudar el torneo",
      text: "No empieza ninguna partida nueva; las que están en curso continúan.",
      isPaused: "El torneo está en pausa: no empieza ninguna partida nueva.",
    },
    people: {
      title: "Cambiar participantes",
      change: "Cambiar…",
      remove: "Quitar…",
      removeDo: "Quitar ahora",
      removeOpen: (name) =>
        `¿Quitar a ${name}? La plaza queda libre. Quien tenga el código puede inscribirse de nuevo.`,
      removePlaying: (name) =>
        `¿Quitar a ${name}? Un sustituto termina la partida en curso; las demás se pierden por incomparecencia.`,
      replace: "Dar la plaza a",
      somebody: "otra persona",
      agent: (name) => `el agente «${name}»`,
      newName: "Nombre de la otra persona",
      replaceDo: "Sustituir",
      linkFor: (name) => `Envía este enlace solo a ${name}; contiene la plaza.`,
      linkSent: "Ya lo he entregado",
    },
    games: {
      title: "Cambiar partidas",
      text: "«Llamar ahora» pone una partida delante de todas. «Aplazar» la pone detrás de las demás y no cuesta ninguna llamada.",
      call: "Llamar ahora",
      postpone: "Aplazar",
      more: (count) => plural(count, { one: "… y # partida más", other: "… y # partidas más" }),
    },
    close: "Cerrar el torneo…",
    closeOpen: "Nadie podrá inscribirse y no se jugará ninguna partida.",
    closePlaying:
      "Las partidas en curso se interrumpen. Los resultados obtenidos se conservan, y la clasificación no es definitiva.",
    closeDo: "Cerrarlo ahora",
  },
};
