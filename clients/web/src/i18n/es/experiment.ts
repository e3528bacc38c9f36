// Spanish texts of experiment/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("es");

export const experiment: Texts["experiment"] = {
  join: {
    title: "Te invitamos a participar en un estudio",
    as: (name) => `Participas como ${name}.`,
    atSeat: (seat) => `Tu asiento es el número ${seat + 1}.`,
    consent: "Antes de empezar",
    fromHost: "Este texto es de la persona que te ha invitado, no de quienes han hecho esta página.",
    agree: "Lo he leído y estoy de acuerdo",
    decline: "No estoy de acuerdo",
    declined: "No participas. No se ha guardado nada; puedes cerrar esta página.",
    before: "Primero, un cuestionario",
    beforeText: (host) => `Se abre en una ventana nueva, en ${host}. Vuelve aquí cuando hayas terminado.`,
    open: "Abrir el cuestionario",
    done: "Lo he rellenado",
    reconsider: "Leerlo otra vez",
    gone: "Este enlace ya no funciona: la sala se ha cerrado o la partida ha terminado. Pregunta a la persona que te lo envió.",
    taken: (name) => `Alguien ya ha ocupado un asiento con este enlace en este dispositivo, como ${name}.`,
    goOn: (name) => `Continuar como ${name}`,
    another: "Ocupar otro asiento",
    held: (name) => `${name} ya tiene un asiento en esta sala en este dispositivo.`,
    oneSeat: (name) =>
      `Un dispositivo solo puede tener un asiento por sala. Si aquí se sienta otra persona, el asiento de ${name} queda libre.`,
    begun: (name) =>
      `La partida ha empezado, y en este dispositivo solo puede continuar ${name}. Abre este enlace en otro dispositivo.`,
    giveBack: (name, as) => `Dejar el asiento de ${name} y participar como ${as}`,
    seated: (name) =>
      `${name} ya tiene un asiento. Continúa en el dispositivo en el que te sentaste; si no fuiste tú, pregunta a la persona que te envió este enlace.`,
    takenPlace: (name) => `Alguien ya se ha inscrito con este enlace en este dispositivo, como ${name}.`,
    heldPlace: (name) => `${name} ya participa en este torneo en este dispositivo.`,
    onePlace: (name) =>
      `Un dispositivo juega por un solo participante. Si aquí se inscribe otra persona, ${name} no podrá jugar más partidas.`,
    joinAs: (name) => `Participar como ${name}`,
    anotherPlace: "Inscribir a otra persona",
    come: { room: "Sentarse a la mesa", tournament: "Inscribirse en el torneo" },
    recorded: {
      room: "La partida se registra: el nombre de arriba, tus decisiones y el tiempo de cada una, y las reacciones que muestras. Nada más.",
      tournament:
        "Las partidas se registran: el nombre de arriba, tus decisiones y el tiempo de cada una, y las reacciones que muestras. Nada más. Quédate en esta página: tus partidas empiezan aquí automáticamente.",
    },
    over: "Has participado en este estudio",
    timed: "El tiempo que tardas se mide también en este dispositivo y se registra con tus decisiones.",
  },
  after: {
    title: "Gracias por jugar",
    text: (host) => `Una última cosa: un cuestionario en ${host}.`,
    whose: (name) => `Es para ${name}.`,
  },
  links: {
    title: "Enlaces para un estudio",
    text: "Un enlace que fija quién participa, en qué asiento e idioma, y qué ve. Todo esto está en el propio enlace; el servidor no guarda nada.",
    tournamentText:
      "Un enlace que fija quién participa, en qué idioma y qué ve en cada partida. Todo esto está en el propio enlace; el servidor no guarda nada.",
    hosted:
      "Para condiciones que asigna el servidor, consentimiento registrado y cuestionarios integrados, crea mejor un estudio:",
    where: "Dónde juegan",
    here: "todos en esta sala",
    names: "Participantes, uno por línea",
    namesHint: "Seudónimos como P07, o P01-P20 para veinte. Si está vacío, cada cual elige un nombre.",
    tooManyNames: (most) => `${most} como máximo a la vez; los demás quedan fuera.`,
    tooLong: (most) => `Un nombre puede tener ${most} caracteres como máximo; los más largos no reciben enlace.`,
    seat: "Asiento del primer participante; los demás le siguen",
    anySeat: "cualquier asiento libre",
    language: "Idioma",
    browserLanguage: "el del navegador",
    hide: "Ocultar en la mesa",
    hidden: {
      log: "qué ha pasado",
      lookup: "jugadas posibles",
      expressions: "reacciones",
      played: "cartas jugadas en el Shift",
      pages: "enlaces a otras páginas",
    },
    times: "Registrar también el tiempo medido en el navegador",
    timesHint: "Se guarda como anotación de cada decisión, junto a la medida del servidor.",
    consent: "Texto del consentimiento",
    consentHint: "Los participantes deben aceptarlo antes de sentarse. Texto sin formato.",
    consentTournamentHint: "Los participantes deben aceptarlo antes de inscribirse. Texto sin formato.",
    before: "Dirección de un cuestionario antes de jugar",
    after: "Dirección de un cuestionario después de jugar",
    beforeHint: "https://…; {name} se sustituye si el enlace fija un nombre.",
    afterHint: "https://…; {name} y {room} se sustituyen.",
    afterTournamentHint: "Aparece cuando termina el torneo. https://…; {name} y {tournament} se sustituyen.",
    notAnAddress: "Escribe una dirección que empiece por https:// o http://.",
    tooMany: (seats) =>
      plural(seats, {
        one: "Hay más nombres que asientos: solo hay # asiento disponible.",
        other: "Hay más nombres que asientos: solo hay # asientos disponibles.",
      }),
    own: {
      label: "cada uno en una sala propia como esta",
      namesHint: "Seudónimos como P07, o P01-P20 para veinte: se crea una sala para cada uno.",
      seat: "Su asiento",
      text: "Cada sala recibe las reglas, los tiempos y los agentes de esta. Este dispositivo guarda lo que necesita para cerrarlas. Sus enlaces quedan aquí en la lista, cada uno con los ajustes que tenía este formulario cuando se creó su sala.",
      barred: {
        seed: "Las cartas de esta sala están fijadas por una semilla secreta; en las otras salas se reparten al azar.",
        real: "Esta sala tiene una mesa con cartas reales, y no hay una segunda mesa.",
        hands:
          "Esta sala empieza con manos fijadas de antemano, que aquí no se conocen; por eso no se puede crear otra igual.",
      },
      wait: "Cada sala espera",
      waitHint: "Si el participante no ha llegado para entonces, la sala se cierra y el enlace deja de funcionar.",
      time,
      namesMissing: "Escribe arriba los participantes.",
      make: (count) => plural(count, { one: "Crear # sala", other: "Crear # salas" }),
      making: (made, all) => `${made} de ${all} salas creadas…`,
      keptMade: (made, missing) => `${made} creadas y en la lista de abajo; ${missing} por crear.`,
    },
    copyAll: "Copiar todos",
    download: "Descargar como tabla (CSV)",
    result: "Enlaces",
    everybody: "todos",
  },
};
