// Spanish texts of attend/: the attendant of a table with real cards.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("es");

/** The names of a list in English, "Ada, Bo and Cy", in Spanish: "e" before the sound of an i. */
const names = (list: string) => list.replace(/ and (?=h?i(?![aeou]))/i, " e ").replace(" and ", " y ");

export const attend: Texts["attend"] = {
  title: "Atender la mesa",
  heading: (room) => room || "Mesa con cartas reales",
  noTicket:
    "Este dispositivo no puede anotar nada de esta mesa. Abre el enlace para atenderla, o escanea su código QR, en el dispositivo que creó la sala.",
  gone: "Esta mesa ya no existe, o el enlace es incorrecto.",
  now: {
    label: "Qué espera la mesa",
    waiting: "Esperando a los jugadores a distancia",
    waitingText: "La partida empieza en cuanto todos los asientos a distancia estén ocupados y conectados.",
    hand: (name) => `Muestra la mano de ${name}`,
    handText: "Sostén las cartas de modo que la cámara las vea todas, o escríbelas abajo. No las enseñes a los demás.",
    special: "¿Alguien declara una acción especial?",
    specialOf: (name) => `${name} decide sobre una acción especial`,
    specialText: "Puede hacerlo quien tenga los dos comodines. Anota quién declara, o que no lo hace nadie.",
    gift: (name) => `${name} da cartas`,
    giftOf: (name) => `${name} elige qué dar`,
    giftText: "Anota el intercambio cuando las cartas hayan cambiado de manos. No hace falta verlas.",
    opening: (face) => `Quien tiene el ${face} dorado abre el Shift`,
    turn: (name) => `Le toca a ${name}`,
    turnOf: (name) => `${name} está decidiendo`,
    remoteText: "Juega a distancia. No hay nada que hacer hasta que llegue la decisión.",
    question: "Una pregunta para ti",
    questionText: "La partida continúa cuando se responda.",
    confirmation: "¿Se leyó bien la última jugada?",
    confirmationText:
      "Entonces la partida ha terminado. Si no, corrígela; sin anotación, el resultado vale a los 20 segundos.",
    confirm: "Sí, la partida ha terminado",
    over: "La partida ha terminado",
    paused: "En pausa",
    pausedText: "Los relojes están parados. Las anotaciones siguen contando.",
    pause: "Pausa",
    resume: "Continuar",
  },
  violation: {
    label: "No permitido",
    todo: "No cuenta. Pide que se retiren las cartas, o corrige lo que se leyó mal.",
    takenBack: "Cartas retiradas",
    reenter: "Escribir lo que hay de verdad",
    correct: "Corregir una anotación anterior",
  },
  questions: {
    picture: "Lo que ve la cámara",
    withdraw: "Sin respuesta",
    words: (text) => {
      const [, passed] = /^Did (.+) pass\?$/.exec(text) ?? [];
      if (passed) return `¿${passed.includes(" and ") ? "Han" : "Ha"} pasado ${names(passed)}?`;
      const [, leads] = /^Is that a new play by (.+)\?$/.exec(text) ?? [];
      if (leads) return `¿Es una jugada nueva de ${leads}?`;
      return text === "Who opened the Shift?" ? "¿Quién ha abierto el Shift?" : text;
    },
    option: (text) => {
      const [, name, play] = /^No, (.+) passed before (.+)$/.exec(text) ?? [];
      if (name) return `No, ${name} había pasado antes (${play})`;
      return text === "Yes" ? "Sí" : text === "No" ? "No" : text;
    },
  },
  toLay: {
    title: "Por hacer en la mesa",
    lay: (name) => `Pon por ${name}`,
    pass: (name) => `Muestra la carta «paso» de ${name}`,
    give: (name, to) => `Pasa las cartas de ${name} a ${to}`,
    foodFight: (name) => `Anuncia: ${name} declara Food Fight`,
    dinner: (name) => `Anuncia: ${name} declara Dinner is Served`,
    done: "Hecho",
  },
  enter: {
    title: "Escribir a mano",
    what: "Qué ha pasado",
    kinds: {
      turn: "Jugada o pase",
      hand: "Una mano",
      special: "Acción especial",
      gift: "Intercambio",
      role: "Rol tomado",
      passWithdrawn: "Pase retirado",
      cleared: "Tablero vaciado",
    },
    seat: "Quién",
    face: "Valor",
    number: "Cuántas",
    jokers: "Comodines con ellas",
    fewer: (what) => `Menos: ${what}`,
    more: (what) => `Más: ${what}`,
    golden: (face) => `El ${face} dorado está entre ellas`,
    notAllowed: "ahora no permitido",
    lay: "Anotar la jugada",
    lays: (name, cards) => `${name} pone ${cards}`,
    pass: "Pasa",
    passes: (name) => `${name} pasa`,
    passWithdrawn: (name) => `${name} retira el pase`,
    clearedText: "La pizza está lista y las cartas se han quitado del tablero.",
    declares: (name) => `${name} declara`,
    nobodyDeclares: "Nadie declara",
    giftUnseen: (name) => `${name} ha dado, cartas no vistas`,
    giftSeen: (name) => `${name} ha dado estas cartas`,
    handSeen: (name) => `Esta es la mano de ${name}`,
    role: "Rol",
    takesRole: (name, role) => `${name} es ${role}`,
    whoFirst: "Elige quién ha sido.",
    hand: {
      label: "Cartas",
      hint: "Escríbelas, por ejemplo 3 4 4 11 J o 2x4, o tócalas abajo.",
      tap: "Toca para añadir",
      remove: (card) => `Quitar ${card}`,
      add: (card) => `Añadir ${card}`,
      count: (count, of) =>
        of === undefined ? plural(count, { one: "# carta", other: "# cartas" }) : `${count} de ${of} cartas`,
      clear: "Vaciar",
      word: (word) => `«${word}» no es una carta. Escribe números, y J para un comodín.`,
      tooMany: (face, all) =>
        plural(all, {
          one: `La baraja solo tiene # carta de valor ${face}.`,
          other: `La baraja solo tiene # cartas de valor ${face}.`,
        }),
      tooManyJokers: (all) =>
        plural(all, { one: "La baraja solo tiene # comodín.", other: "La baraja solo tiene # comodines." }),
      mustBe: (count) => plural(count, { one: "La mano tiene # carta.", other: "La mano tiene # cartas." }),
    },
  },
  reports: {
    title: "Anotaciones de este Shift",
    none: "Todavía no se ha anotado nada.",
    assumed: "(se supone quién fue)",
    change: "Cambiar",
    remove: "Eliminar",
    removeSure: "Es como si nunca hubiera pasado. También se elimina lo que después ya no encaja.",
    changeTitle: (text) => `Cambiar: ${text}`,
    changeText: "¿Qué ha pasado en su lugar? Todo lo posterior se vuelve a juzgar.",
    laid: (name, cards) => `${name} ha puesto ${cards}`,
    passed: (name) => `${name} ha pasado`,
    passWithdrawn: (name) => `${name} ha retirado el pase`,
    hand: (name) => `Se ha visto la mano de ${name}`,
    cleared: "El tablero se ha vaciado",
    declared: (name) => `${name} ha declarado una acción especial`,
    nobodyDeclared: "Nadie ha declarado una acción especial",
    gave: (name) => `${name} ha dado cartas`,
    gaveCards: (name, cards) => `${name} ha dado ${cards}`,
    role: (name, role) => `${name} ha tomado la carta ${role}`,
  },
  outcome: {
    accepted: "Anotado.",
    known: "Ya se sabía.",
    held: "Espera la respuesta a una pregunta.",
    notSent: "No se ha enviado, porque la anotación anterior no cuenta. Mira la mesa y escríbela de nuevo.",
    violation: "No permitido. No cuenta.",
    void: (count) =>
      plural(count, {
        one: "Corregido. # anotación posterior ya no encaja y se ha eliminado: escribe de nuevo lo que ha pasado.",
        other:
          "Corregido. # anotaciones posteriores ya no encajan y se han eliminado: escribe de nuevo lo que ha pasado.",
      }),
  },
  seats: {
    remote: "a distancia",
    handKnown: "mano conocida",
    handUnknown: "mano desconocida",
    passed: "ha pasado",
    next: "juega",
  },
  link: {
    title: "En una tableta junto a la mesa",
    text: "Quien tenga esta dirección puede anotar lo que pasa en la mesa. Enséñala solo a quienes la atienden.",
    qr: "Código QR de la vista para atender la mesa",
  },
  room: {
    realCards: "cartas reales",
  },
};
