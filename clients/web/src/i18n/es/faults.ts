// What can go wrong in a call, in Spanish.

import type { Texts } from "../texts";
import { time } from "./time";

export const faults: Texts["faults"] = {
  notReached: "El servidor no responde. Quizá se está reiniciando; inténtalo de nuevo en un momento.",
  unknown: "Algo ha salido mal.",
  tooMuch: "Demasiadas peticiones a la vez.",
  again: (ms: number) => `Inténtalo de nuevo dentro de ${time(ms)}.`,
  pageBroken:
    "Se ha producido un error en esta página. Vuelve a cargarla: tu sitio y todo lo que hay en la mesa se conservan.",
  byReason: {
    TOKEN_MISSING:
      "Este servidor está abierto solo a personas invitadas. Pide un enlace con token a quien lo administra y ábrelo aquí.",
    TOKEN_UNKNOWN:
      "El servidor no conoce el token de tu enlace. Comprueba que has abierto el enlace completo, o pide uno nuevo a quien administra el servidor.",
    TOKEN_EXPIRED: "El token de tu enlace ha caducado. Pide un enlace nuevo a quien administra el servidor.",
    ROLE_TOO_LOW: "Tu enlace no permite hacer esto. Pide uno que lo permita a quien administra el servidor.",
    OUT_OF_SCOPE: "Tu enlace es para otra sala u otro torneo.",
    ROOM_UNKNOWN: "Esta sala ya no existe, o es privada.",
    ROOM_FULL: "Todos los asientos de esta sala están ocupados.",
    SEAT_TAKEN: "Alguien acaba de ocupar este asiento.",
    NO_SUCH_SEAT: "Esta sala no tiene ese asiento.",
    KIND_NOT_ADMITTED: "Los asientos libres están reservados para otros tipos de participantes.",
    CLIENT_HAS_SEAT: "Ya tienes un asiento en esta sala, y cada cual puede ocupar solo uno.",
    GAME_STARTED: "La partida ya ha empezado. Puedes verla.",
    GAME_OVER: "La partida ha terminado.",
    SEAT_ASSIGNED: "Este asiento pertenece al estudio. Para retirarte, usa la página del estudio.",
    GAME_NOT_STARTED: "La partida todavía no ha empezado.",
    GAME_NOT_PHYSICAL: "Esta partida no se juega con cartas reales.",
    NO_PHYSICAL_TABLES:
      "Este torneo no tiene partidas con cartas reales, así que no se puede añadir a nadie en una mesa.",
    NO_SUCH_OPTION: "La pregunta no tiene esa respuesta, o ya se ha respondido.",
    TOO_MANY_QUESTIONS: "Hay demasiadas preguntas abiertas. Respóndelas primero.",
    TOO_MANY_SEATINGS: "Los asientos de esta sala se han ocupado y dejado demasiadas veces. Pide una sala nueva.",
    TOO_MANY_HELD_REPORTS:
      "Espera: primero hay que responder una pregunta. De la respuesta dependen las anotaciones que esperan.",
    NOT_CORRECTABLE: "Esta anotación ya no se puede corregir.",
    JOIN_CODE_WRONG:
      "Este código no corresponde a ninguna sala ni torneo en el que puedas entrar. Compruébalo; también puede que la partida haya terminado.",
    TICKET_UNKNOWN: "Este asiento se dejó libre. Entra de nuevo con el código.",
    SPECTATORS_NOT_ADMITTED: "Esta sala no admite espectadores.",
    TOO_MANY_SPECTATORS: "Esta sala ya tiene tantos espectadores como admite.",
    DECISION_CLOSED: "Esta decisión ya no está abierta.",
    CHAT_OFF: "En esta sala no se puede escribir; hay frases preparadas.",
    HINTS_OFF: "En esta sala no hay pistas.",
    TOO_MANY_HINTS: "Ya has recibido todas las pistas para esta decisión.",
    TOO_MANY_EXPRESSIONS: "Demasiadas reacciones a la vez. Espera un momento.",
    TOO_MANY_ROOMS:
      "Ahora no se pueden crear más salas. Cierra una que ya no necesites, o espera a que termine alguna.",
    TOO_MANY_CALLS: "El servidor recibe demasiadas peticiones de tu red, o con tu enlace.",
    TOO_MANY_CALLS_AT_ONCE: "El servidor recibe demasiadas peticiones de tu red, o con tu enlace.",
    TOO_MANY_UNREAD_ANSWERS: "El servidor recibe demasiadas peticiones de tu red, o con tu enlace.",
    TOO_MANY_LARGE_MESSAGES: "El servidor recibe demasiadas peticiones de tu red, o con tu enlace.",
    TOO_MANY_WAITING_CALLS:
      "El servidor recibe demasiadas peticiones de tu red, o con tu enlace. Vuelve a cargar la página.",
    TOO_MANY_STREAMS: "Hay demasiadas páginas y agentes conectados desde tu red, o con tu enlace. Cierra algunos.",
    TOO_MANY_FOLLOWERS: "En este momento demasiadas personas siguen torneos.",
    TOO_MANY_WRONG_CODES: "Se han escrito demasiados códigos incorrectos. Comprueba el código.",
    READER_TOO_SLOW: "Tu conexión es demasiado lenta para cargar esto. Inténtalo con una mejor.",
    DISK_NEARLY_FULL:
      "El disco del servidor está casi lleno: no puede empezar nada nuevo. Quien lo administra debe liberar espacio. Las partidas en curso continúan.",
    STORE_FAILED:
      "El servidor no puede guardar partidas y se está deteniendo. Tus decisiones hasta ahora están guardadas; las partidas se reanudan cuando vuelva.",
    OWNER_UNREACHABLE:
      "No se puede conectar con el servidor que se encarga de esto, o lo está relevando otro. Inténtalo de nuevo en un momento.",
    NODE_NOT_REACHED:
      "Los demás servidores no alcanzan a este, que por eso no acepta nada nuevo. Inténtalo de nuevo en un momento; si vuelve a fallar, avisa a quien administra el servidor.",
    ROOM_GONE: "Esta sala se acaba de cerrar, o el servidor se está deteniendo. Inténtalo de nuevo en un momento.",
    INTERNAL:
      "El servidor no ha podido hacerlo. Inténtalo de nuevo; si vuelve a fallar, avisa a quien administra el servidor.",
    SHUTTING_DOWN: "El servidor se está apagando. Las partidas se reanudan cuando vuelva.",
    GAME_UNKNOWN: "El servidor no tiene ningún registro de esta partida, o es privada.",
    RECORD_UNREADABLE:
      "El registro de esta partida está dañado. Avisa al operador del servidor. Las demás partidas no están afectadas.",
    GAME_RUNNING: "La partida sigue en curso. Su registro estará disponible cuando termine.",
    SERIES_OPEN:
      "Otras partidas con las mismas cartas siguen en curso. El registro estará disponible cuando termine la ronda.",
    TOURNAMENT_UNKNOWN: "Este torneo no existe, o es privado.",
    TOURNAMENT_STARTED: "El torneo ya ha empezado.",
    TOO_FEW_PARTICIPANTS: "Antes de empezar deben inscribirse al menos dos participantes.",
    TOO_MANY_TOURNAMENTS:
      "Ahora no se pueden crear más torneos. Cierra uno que ya no necesites, o espera a que termine alguno.",
    OWNER_TOKEN_WRONG: "Esto solo puede hacerlo el dispositivo que lo creó.",
    NOT_STATELESS: "Las personas no pueden inscribirse: las mismas cartas se juegan varias veces.",
    TOURNAMENT_FULL: "El torneo está completo.",
    NAME_REFUSED: "Este nombre tiene más de 64 caracteres o contiene caracteres invisibles. Elige otro.",
    NAME_RESERVED: "Así se llaman los agentes integrados que completan las mesas. Elige otro nombre.",
    PARTICIPANT_UNKNOWN: "Este participante ya no existe.",
    PARTICIPANT_IS_FILLER: "Este agente completa las mesas y no puede irse. Puedes sustituirlo.",
    REPLACED_TOO_OFTEN: "Esta plaza ya ha cambiado de manos tantas veces como es posible.",
    TOURNAMENT_OVER: "El torneo ha terminado.",
    TOURNAMENT_NOT_PLAYING: "Solo es posible mientras el torneo está en curso.",
    GAME_NOT_DUE: "Mientras tanto, la partida ha empezado o ha terminado.",
    NOBODY_LEFT: "Todos los participantes de esta partida se han ido. Sustituye primero a uno.",
    NOT_IN_GAME: "No juegas en esta partida.",
    POSTPONED_TOO_OFTEN: "Ya has aplazado esta partida tantas veces como es posible. Pregunta a la organización.",
    TOO_MANY_CHANGES: "Este torneo se ha cambiado demasiadas veces.",
    NAME_TAKEN: "Otra persona ya tiene este nombre. Elige otro.",
    LINK_UNKNOWN:
      "Este enlace no pertenece a ningún estudio de este servidor. Compruebe que ha abierto el enlace completo, o pregunte a la persona que se lo dio.",
    PANEL_ID_TAKEN: "Alguien con este identificador ya participa. Siga en el navegador en el que empezó.",
    PANEL_ID_REFUSED: "El enlace no tiene un identificador válido. Ábralo de nuevo desde el sitio que le ha invitado.",
    SESSION_UNKNOWN: "La conexión con el estudio se ha interrumpido. Abra su enlace de nuevo.",
    SESSION_SUPERSEDED: "El estudio se ha abierto en otra ventana o en otro dispositivo. Continúa allí.",
    STUDY_FULL: "Todas las plazas de este estudio están ocupadas. Gracias por su interés.",
    WRONG_DEVICE: "Este estudio necesita otro dispositivo.",
    STUDY_CLOSED: "Este estudio está cerrado. Gracias por su interés.",
    STUDY_RUNNING: "Hay participantes en mitad de este estudio. Espera a que terminen o quítalos.",
    STUDY_UNKNOWN: "Este estudio no existe, o la clave no le pertenece.",
    TOO_MANY_STUDIES: "En este servidor no se pueden crear más estudios.",
    TOO_MANY_SESSIONS: "Este estudio se ha abierto demasiadas veces en poco tiempo. Inténtelo de nuevo en un momento.",
    TOO_MANY_PARTICIPANTS: "No se pueden añadir más participantes a este estudio.",
    PARTICIPATION_OVER: "Esta participación ha terminado.",
    ANSWER_REFUSED: "Una respuesta no está entre las posibles. Revise sus respuestas.",
    TOO_MANY_ANSWERS:
      "El servidor no tiene memoria para más respuestas. Acorte las suyas, o pregunte a quien le dio el enlace.",
    GAME_NOT_OVER: "La partida todavía no ha terminado.",
    COUNT_REFUSED: "Escribe un número del 1 al 1000.",
  },
};
