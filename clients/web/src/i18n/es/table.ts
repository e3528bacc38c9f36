// Spanish texts of table/.

import { AbortReason, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { ViolatedRule } from "../../gen/chefshat/v1/table_pb";
import { numerals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("es");
const number = numerals("uno dos tres cuatro cinco seis siete ocho nueve diez once doce trece catorce quince");

export const table: Texts["table"] = {
  title: "Mesa",
  heading: {
    waiting: "Esperando a todos",
    before: (shift) => `Shift ${shift} · antes de la primera pizza`,
    turn: (shift, pizza, turn) => `Shift ${shift} · Pizza ${pizza} · Turno ${turn}`,
    shiftOver: (shift) => `El Shift ${shift} ha terminado`,
    gameOver: "La partida ha terminado",
    aborted: "La partida se ha interrumpido",
  },
  you: "tú",
  freeSeat: "asiento libre",
  pointsWord: (count) => plural(count, { one: "punto", other: "puntos" }),
  chips: { toPlay: "juega", toGive: "da", toDeclare: "¿declara?", passed: "ha pasado", played: "ha jugado" },
  presence: {
    away: "sin conexión",
    substituted: (agent) => `juega ${agent}`,
  },
  card: {
    face: (face, ingredient) => `${face}, ${ingredient}`,
    golden: (face, ingredient) => `${face} dorado, ${ingredient}`,
    joker: "comodín",
    received: "recibida en el intercambio",
  },
  play: (quantity, face, golden, jokers) => {
    const one = golden ? `el ${face} dorado` : `un ${face}`;
    const cards = quantity === 1 ? one : `${number(quantity)} ${face}${golden ? " (uno dorado)" : ""}`;
    return cards + (jokers === 0 ? "" : plural(jokers, { one: " con comodín", other: " con # comodines" }));
  },
  jokers: (count) => plural(count, { one: "un comodín", other: "# comodines" }),
  board: { label: "Tablero", empty: "El tablero está vacío", by: (cards, name) => `${cards} · ${name}` },
  hand: {
    label: "Tu mano",
    of: (name) => `Mano de ${name}`,
    empty: "Sin cartas",
    help: "Las flechas mueven, la barra espaciadora elige una carta, Intro juega las elegidas, Esc las devuelve todas.",
    keysHelp: "El número de una carta también la elige, p pasa y el signo de interrogación muestra todas las teclas.",
  },
  log: {
    title: "Qué ha pasado",
    dealt: (shift) => `Se reparten las cartas del Shift ${shift}`,
    plays: (cards) => `juega ${cards}`,
    passes: "pasa",
    finishes: (place) => `queda ${place}`,
    pizzaDone: (pizza, next) => `La pizza ${pizza} está lista, empieza ${next}`,
    foodFight: "declara Food Fight: todos los roles se invierten",
    dinner: "declara Dinner is Served: no hay intercambio",
    gives: (what, to) => `da ${what} a ${to}`,
    shiftOver: (shift, winner) => `El Shift ${shift} ha terminado, ${winner} ha acabado antes que nadie`,
    shows: (expression) => `muestra ${expression}`,
    says: (phrase) => `dice «${phrase}»`,
    seated: "se sienta",
    left: "se va",
    lost: "pierde la conexión",
    back: "ha vuelto",
    substituted: (agent) => `recibe un sustituto: ${agent}`,
    restarted: "El servidor se ha reiniciado; la partida continúa",
    gameStarted: "La partida empieza",
    gameOver: "La partida ha terminado",
    aborted: "La partida se ha interrumpido",
    causes: {
      agent: "",
      timeout: "tiempo agotado",
      invalid: "sin respuesta válida",
      disconnected: "sin conexión",
      substitute: "por un sustituto",
      recorded: "como se registró",
      table: "",
    },
    handReported: (name) => `El árbitro ha visto la mano de ${name}`,
    violated: (text) => `recibe un aviso del árbitro: ${text}`,
    corrected: () => "Se ha corregido un error de lectura",
    paused: "La partida está en pausa",
    resumed: "La partida continúa",
  },
  physical: {
    atTable: "en la mesa",
    paused: "La partida está en pausa en la mesa.",
    violation: (name, text) => (name ? `${name}: ${text}` : text),
    handAwaited: "Tus cartas están en camino",
    handAwaitedText:
      "Quien atiende la mesa muestra tus cartas a la cámara o las escribe. Aparecen aquí en cuanto se conocen.",
    handUnknown: "Esta mano no se conoce.",
  },
  violation: ({ rule, text, top, highest, fewest, onBoard, golden, next }) => {
    switch (rule) {
      case ViolatedRule.TURN:
        return next ? `No es su turno: le toca a ${next}.` : "No es su turno.";
      case ViolatedRule.FACE:
        if (!onBoard) return text;
        if (highest === 0) return "Nada supera a la trufa del tablero: solo se puede pasar.";
        if (highest === top) return "En el tablero hay un comodín solo: lo supera cualquier ingrediente.";
        return `En el tablero ya hay cartas de valor ${highest + 1}: hace falta ${highest === 1 ? "un 1" : `un ${highest} o un número más bajo`}.`;
      case ViolatedRule.SIZE:
        return plural(fewest, { one: "Hace falta al menos # carta.", other: "Hacen falta al menos # cartas." });
      case ViolatedRule.FORM:
        return "Una jugada es de cartas de un mismo valor, con o sin comodines, o de un comodín solo.";
      case ViolatedRule.OPENING:
        return golden
          ? `El Shift se abre con el ${top} dorado: solo cartas de valor ${top} y comodines con él.`
          : `El Shift se abre con el valor ${top}: ningún otro.`;
      case ViolatedRule.PASS:
        return "Ahora no se puede pasar.";
      case ViolatedRule.DECISION:
        return "La decisión tomada a distancia fue otra.";
      default:
        return text;
    }
  },
  now: {
    yourTurn: "Te toca",
    turnOf: (name) => `Le toca a ${name}`,
    giveOf: (name) => `${name} da una carta`,
    declareOf: (name) => `${name} puede declarar`,
    wait: "Esperando a los demás",
    awaited: (name, seconds) => `Esperando a ${name} desde hace ${seconds}\u00a0s`,
    awaitedAway: (name, seconds) =>
      seconds === undefined ? `Esperando a ${name} (ausente)` : `Esperando a ${name} (ausente): ${seconds}\u00a0s`,
    waitExchange: "Las cartas están repartidas",
    youGive: "Das una carta",
    youGiveOf: (number, of) => `Das la carta ${number} de ${of}`,
    youMayDeclare: "Tienes los dos comodines",
    orLower: "o más bajo",
    cards: "cartas",
    openingGolden: "hay que jugar la carta dorada",
    openingFace: "ningún otro valor",
    anything: "Una pizza nueva: vale cualquier jugada.",
    beat: (highest, fewest) =>
      `${highest}${highest > 1 ? " o más bajo" : ""}, al menos ${plural(fewest, { one: "# carta", other: "# cartas" })}.`,
    nothing: "Nada supera estas cartas. Tienes que pasar.",
    opens: "Abre el Shift y no puede pasar.",
    opensMayPass: "Abre el Shift.",
    giveTo: (name) => `Intercambio: elige una carta para ${name}.`,
    give: "Intercambio: elige una carta para dar.",
    foodFight: "Food Fight invertiría todos los roles: serías Chef.",
    dinner: "Con Dinner is Served no habría intercambio.",
    finished: (place) => `Has quedado ${place}.`,
    outOfPizza: "Has pasado y estás fuera hasta la próxima pizza.",
  },
  played: { title: "Jugadas en este Shift", allOut: "todas jugadas" },
  actions: {
    label: "Tu decisión",
    play: "Jugar",
    playCards: (cards) => `Jugar ${cards}`,
    pass: "Pasar",
    give: "Dar",
    giveCard: (card) => `Dar ${card}`,
    foodFight: "Food Fight!",
    dinner: "Dinner is Served!",
    decline: "No declarar",
    putBack: "Devolver",
    pick: "Elige cartas, o pasa.",
    pickMust: "Elige las cartas que juegas.",
    onlyPass: "Ninguna de tus cartas se puede jugar aquí.",
    autoPassing: "No puedes jugar aquí: la página pasa por ti…",
    planHint: "No te toca. Ya puedes elegir qué hacer después.",
    plan: (cards) => (cards ? `Luego: ${cards}` : "Luego: jugar"),
    planPass: "Luego: pasar",
    planned: (what) => `Elegido para tu turno: ${what}`,
    planOff: (what) => `Ya no es posible: ${what}. Elige de nuevo.`,
    unplan: "Deshacer la elección",
    more: (count) => plural(count, { one: "Elige una carta más.", other: "Elige # cartas más." }),
    ready: "Se puede jugar.",
    hint: "Pista",
    hintComes: "Calculando la pista…",
    suggested: (move) => `Jugada sugerida: ${move}`,
    points: (points, error) => `${points} ± ${error} puntos`,
    sending: "Enviando…",
    noPass: "Elige cartas: quien abre no puede pasar.",
    mustPlay: "Hace tiempo que nadie juega: tienes que jugar.",
  },
  reasons: {
    openingGolden: (face) => `Juega el ${face} dorado, solo con ${face} y comodines.`,
    openingFace: (face) => `El Shift se abre con el valor ${face}: ningún otro.`,
    notRarer: (face, board) => `El ${face} no supera al ${board}: juega uno más bajo.`,
    nothingRarer: "Nada supera las cartas del tablero.",
    tooFew: (need, have) =>
      `${plural(need, { one: "Necesitas # carta", other: "Necesitas # cartas" })} de un valor; tienes ${have}.`,
    jokerAlone: "Un único comodín solo puede abrir una pizza.",
    other: "Esta carta no se puede jugar ahora.",
    declareFirst: "Decide primero si declaras.",
    gift: "Esta carta no se puede dar ahora.",
    notYourTurn: "No te toca.",
    notHeld: (face) => (face === undefined ? "No tienes comodines." : `No tienes cartas de valor ${face}.`),
    noJoker: "No se puede añadir un comodín.",
    mayNotPass: "Ahora no puedes pasar.",
  },
  moments: {
    foodFight: {
      title: (name) => `${name}: Food Fight!`,
      text: "En este Shift todos los roles se invierten: el Lavaplatos es ahora el Chef.",
    },
    dinner: {
      title: (name) => `${name}: Dinner is Served!`,
      text: "En este Shift no se intercambian cartas.",
    },
    exchange: {
      title: () => "El intercambio",
      text: "En el intercambio, el Lavaplatos da al Chef las mejores cartas y recibe otras: es el privilegio del Chef.",
    },
    opening: {
      title: (name) => `${name} juega la carta dorada`,
      text: "Abre el Shift.",
    },
    lastCard: {
      title: (name) => `A ${name} le queda una carta`,
      text: "Quien juega su última carta ocupa el mejor puesto libre.",
    },
  },
  clock: {
    label: "Tiempo",
    bank: (time) => `+ ${time} de reserva`,
    onBank: "de la reserva",
    hurry: (seconds) => `Quedan ${seconds} segundos.`,
  },
  expressions: {
    label: "Muestra cómo te sientes",
    words: {
      joy: "alegría",
      amusement: "diversión",
      surprise: "sorpresa",
      concentration: "concentración",
      annoyance: "fastidio",
      sadness: "tristeza",
    },
    say: "Di algo",
    ownWords: "Con tus palabras",
    sayIt: "Dilo",
    phrases: {
      "good-luck": "¡Suerte!",
      "well-played": "¡Bien jugado!",
      thanks: "¡Gracias!",
      "so-close": "¡Por poco!",
      oops: "¡Ups!",
      sorry: "¡Perdón!",
      thinking: "Déjame pensar…",
      "good-game": "¡Buena partida!",
    },
  },
  tools: {
    label: "Herramientas",
    soundOn: "Sonido activado",
    soundOff: "Sonido desactivado",
  },
  lookup: {
    title: "Jugadas posibles",
    caption: "Todas las jugadas por valor, número de cartas y comodines",
    legal: "permitida",
    notInHand: "admitida, pero no en esta mano",
    notAllowed: "en esta mano, pero no admitida ahora",
    impossible: "ni una cosa ni la otra",
    face: "valor",
    loneJoker: "un comodín solo",
    pass: "pasar",
    count: (count) => plural(count, { one: "# acción permitida", other: "# acciones permitidas" }),
    chosen: "elegida",
    groups: "Filas: valores. Columnas: cartas de ese valor; en cada columna sin comodines, con uno, con dos.",
    signs: "Leyenda",
    none: "No te toca. La tabla aparece en tus turnos.",
  },
  aborted: {
    [AbortReason.UNSPECIFIED]: "No tiene resultado.",
    [AbortReason.CLOSED]: "Quien creó la sala la ha cerrado.",
    [AbortReason.SHUTDOWN]: "El servidor se ha apagado.",
    [AbortReason.PARTICIPANTS_LOST]: "Demasiados participantes han perdido la conexión.",
    [AbortReason.NEVER_STARTED]: "No se ocuparon a tiempo todos los asientos.",
    [AbortReason.TOO_LONG]: "La partida ha superado la duración que el servidor puede guardar.",
  },
  result: {
    shift: (shift) => `Shift ${shift}`,
    game: "Clasificación final",
    total: "Total",
    curve: "Puntos de la partida tras cada Shift, una línea por asiento",
    adjudicated: "Terminado por el límite de turnos.",
    replay: "Ver la repetición",
    youWon: "¡Has ganado!",
    wins: (name) => `Ha ganado ${name}`,
  },
  answers: {
    notLegal: "Acción no permitida. Elige de nuevo.",
    notLegalLeft: (attempts) =>
      attempts === 0
        ? "Acción no permitida. Se ha tomado por ti la decisión predeterminada."
        : plural(attempts, {
            one: "Acción no permitida. Elige de nuevo: queda # intento.",
            other: "Acción no permitida. Elige de nuevo: quedan # intentos.",
          }),
    closed: "Demasiado tarde: ya está decidido.",
    unknownDecision: "La partida ha avanzado. Si no cambia nada, vuelve a cargar la página.",
  },
  link: {
    lost: "Conexión perdida. Reconectando…",
    superseded: "Este asiento se está usando en otra ventana o en otro dispositivo.",
    takeBack: "Jugar aquí",
    substituted: "No estabas: un agente integrado juega por ti.",
    resume: "Ya estoy aquí",
    refused: "No se ha podido ocupar el asiento.",
  },
  room: {
    seats: "Asientos",
    waiting: (count) => plural(count, { one: "# asiento sigue libre", other: "# asientos siguen libres" }),
    away: (count) => plural(count, { one: "falta por conectarse #", other: "faltan por conectarse #" }),
    begins: "La partida empieza en cuanto todos los asientos estén ocupados y conectados.",
    ready: "listo",
    here: "conectado",
    notHere: "sentado, pero sin conexión",
    waitsFor: {
      [ParticipantKind.UNSPECIFIED]: "esperando a cualquiera: una persona, un robot, un agente o un modelo de lenguaje",
      [ParticipantKind.HUMAN]: "esperando a una persona",
      [ParticipantKind.ROBOT]: "esperando a un robot",
      [ParticipantKind.AGENT]: "esperando a un agente",
      [ParticipantKind.MODEL]: "esperando a un modelo de lenguaje",
    },
    ways: "Cómo entran los demás",
    invited: "Quien creó la sala invita a los demás con una dirección o un código de acceso.",
    assigned: "El torneo asigna los asientos. No puede entrar nadie más.",
    byCode: "Quien tenga un código de acceso puede ocupar un asiento libre.",
    toJoin: "Tengo un código de acceso",
    invite: "La invitación está más abajo.",
  },
  watch: {
    viewer: "vista de espectador",
    spectators: (count: number) => plural(count, { one: "# espectador", other: "# espectadores" }),
  },
};
