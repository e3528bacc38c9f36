// Spanish texts of tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";
import { time } from "./time";

const plural = plurals("es");

export const tournaments: Texts["tournaments"] = {
  none: "Todavía no hay ningún torneo. Crea uno, envía su dirección a personas y agentes y sigue aquí la clasificación.",
  sections: {
    open: "Inscripción abierta",
    playing: "En curso",
    over: "Terminados",
    closed: "Cerrados antes de tiempo",
  },
  states: {
    open: "inscripción abierta",
    playing: "en curso",
    paused: "en pausa",
    finished: "terminado",
    closed: "cerrado antes de tiempo",
  },
  formats: { knockout: "Eliminatoria", roundRobin: "Todos contra todos", swiss: "Sistema suizo" },
  deals: {
    same: "Todas las mesas de una ronda reciben las mismas cartas. No hay espectadores ni repeticiones hasta que termina la ronda.",
    rotated: "Cada mesa juega cada reparto una vez por asiento.",
  },
  participants: (count) => plural(count, { one: "# participante", other: "# participantes" }),
  made: (date) => `creado el ${date}`,
  gamesOver: (over, games) => `${over} de ${plural(games, { one: "# partida", other: "# partidas" })} terminadas`,
  roundOf: (round, rounds) => `ronda ${round} de ${rounds}`,
  round: (round) => `Ronda ${round}`,
  final: "Final",
  table: (table) => `Mesa ${table}`,
  game: (number) => `partida ${number}`,
  wall: {
    open: "Vista para pantalla grande",
    close: "Salir de la vista para pantalla grande",
    more: (from, to) => `de ${from} a ${to}`,
    tables: (from, to) => `mesas de ${from} a ${to}`,
    join: "Escanea para inscribirte",
    orCode: (host) => `o abre ${host} y escribe`,
  },
  print: "Imprimir",
  results: {
    title: "Resultados",
    open: "Resultados y diplomas",
    back: "Volver al torneo",
    provisional: (date) => `Situación a ${date}; el torneo no ha terminado.`,
    settings: "Cómo se jugó",
    table: "Mesa",
    game: "Partida",
    result: "Resultado",
    foot: (id) => `Chef’s Hat · torneo ${id}`,
  },
  certificate: {
    heading: "Diplomas",
    text: "En papel o, desde el diálogo de impresión, en PDF. Fírmalos a mano.",
    all: (count) => plural(count, { one: "Imprimir # diploma", other: "Imprimir los # diplomas" }),
    of: "Imprimir el diploma de",
    title: "Diploma",
    placed: (place, of) => `obtuvo el ${place}.º puesto de ${of} en el torneo`,
    tookPart: "participó en el torneo",
    rounds: (count) => plural(count, { one: "# ronda", other: "# rondas" }),
    games: (count) => plural(count, { one: "# partida jugada", other: "# partidas jugadas" }),
    score: (mean) => `puntuación media ${mean}`,
    wins: (count) => plural(count, { one: "# partida ganada", other: "# partidas ganadas" }),
    signature: "Firma de la organización",
  },
  countdown: {
    label: "Empieza en",
    due: "Empieza en cuanto se inscriban dos",
    days: (days, clock) => `${plural(days, { one: "# día", other: "# días" })} ${clock}`,
  },
  play: {
    beginsAt: (count) => `Empieza automáticamente con ${count} participantes`,
    beginsByHand: "Empieza cuando lo inicie la organización",
    beginsOn: (moment) => `Empieza el ${moment}`,
    beginsAtOrOn: (count, moment) => `Empieza con ${count} participantes, a más tardar el ${moment}`,
    knockout: (games) =>
      `${plural(games, { one: "# partida por ronda", other: "# partidas por ronda" })} en mesas de cuatro; los dos primeros pasan de ronda`,
    rounds: (rounds, games) =>
      rounds === 0
        ? `Tantas rondas como exija el número de participantes, de ${plural(games, { one: "# partida", other: "# partidas" })} cada una`
        : `${plural(rounds, { one: "# ronda", other: "# rondas" })} de ${plural(games, { one: "# partida", other: "# partidas" })}`,
    toPoints: (points) => plural(points, { one: "Se juega a # punto", other: "Se juega a # puntos" }),
    shifts: (shifts) => plural(shifts, { one: "Una partida es de # Shift", other: "Una partida es de # Shifts" }),
    clock: (decisionMs, bankMs) =>
      `Las personas tienen ${time(decisionMs)} por decisión${bankMs > 0 ? `, más ${time(bankMs)} para toda la partida` : ""}`,
  },
  standings: {
    title: "Clasificación",
    final: "Clasificación final",
    score: "Puntuación media",
    scoreHint: "Puntos de media por el puesto en una partida. Deciden el orden",
    placesWords: (places) => places.map((count, index) => `${count} × puesto ${index + 1}`).join(", "),
    ratingHint: "Media e incertidumbre, de las partidas puntuables de este torneo",
    round: "Última ronda",
    forfeited: (count) => plural(count, { one: "# incomparecencia", other: "# incomparecencias" }),
    byes: (count) => plural(count, { one: "# descanso", other: "# descansos" }),
    filler: "relleno",
    withdrawn: "se ha ido",
    former: (names) => `antes: ${names}`,
    none: "Todavía no se ha inscrito nadie.",
    field: "Participantes",
  },
  games: {
    title: "Partidas",
    bracket: "Cuadro",
    due: "aún no llamada",
    void: "anulada",
    of: (table, number) => `${table}, partida ${number}`,
    from: (first) => `los dos primeros de la mesa ${first}`,
    forfeited: "no se presentó",
    advances: "pasa de ronda",
    champion: "gana el torneo",
    none: "Las mesas se sortean cuando empieza el torneo.",
    truncated: (count) => `Solo se muestran las primeras ${count} partidas.`,
  },
  confidence: {
    title: "¿Qué seguridad tiene el orden?",
    text: "Estimado a partir de las puntuaciones hasta ahora, para cada par de vecinos de la clasificación.",
    pair: (upper, lower) => `${upper} antes que ${lower}`,
    grades: {
      certain: "casi seguro",
      likely: "probable",
      leaning: "más probable que improbable",
      open: "aún no está claro",
      against: "las puntuaciones sugieren lo contrario",
    },
    percent: (percent) => `${percent} %`,
    more: (games) =>
      plural(games, {
        one: "cerca de # partida más cada uno lo decidiría",
        other: "cerca de # partidas más cada uno lo decidirían",
      }),
  },
  join: {
    title: "Participar",
    text: "Juegas en el navegador. Quédate en esta página: tus partidas empiezan aquí automáticamente.",
    code: "Código de acceso del torneo",
    codeMissing: "Escribe el código que te dio la organización.",
    nameHint: "Lo ven todos. Debe ser único en el torneo.",
    submit: "Inscribirse en el torneo",
    notForPeople: "Las personas no pueden inscribirse en este torneo.",
  },
  part: {
    you: (name) => `Participas como ${name}.`,
    waitOpen:
      "Quédate en esta página. El torneo empieza cuando lo inicie la organización o cuando haya suficientes inscripciones.",
    waitNext: "Quédate en esta página: tu próxima partida empieza aquí automáticamente.",
    waitPaused: "La organización ha pausado el torneo. Tu próxima partida empieza aquí cuando se reanude.",
    postpone: (place) => `Aplazar mi próxima partida (${place})`,
    leave: "Dejar el torneo…",
    leaveDo: "Dejarlo ahora",
    leaveOpen: "Tu plaza queda libre para otros.",
    leavePlaying:
      "Un sustituto termina tu partida en curso, y pierdes las demás por incomparecencia. No puedes volver.",
    left: "Ya no participas en este torneo. Tus resultados hasta ahora cuentan.",
    replaced: "Otra persona ha ocupado tu plaza en este torneo.",
    over: "El torneo ha terminado. Gracias por jugar.",
    superseded: "Participas en otra ventana o en otro dispositivo.",
    takeBack: "Participar aquí",
    begins: (place) => `Tu partida empieza: ${place}.`,
    back: "Volver a la clasificación",
    place: (round, table) => `ronda ${round}, mesa ${table}`,
    toGame: "Ir a mi partida",
    which: {
      title: "¿Qué plaza quieres usar?",
      text: (held, brought) =>
        `En este dispositivo, ${held} ya participa en este torneo. El enlace trae la plaza de ${brought}.`,
      lost: (held) =>
        `Un dispositivo juega por un solo participante. Si usas el enlace aquí, este dispositivo pierde la plaza de ${held}.`,
      stay: (held) => `Continuar como ${held}`,
      take: (brought) => `Participar como ${brought}`,
    },
  },
};
