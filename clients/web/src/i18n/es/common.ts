// Spanish texts that several parts of the page use: the frame, kinds of participants, words of the
// game. The same word stands for the same thing in all parts: face "valor", board "tablero", hand
// "mano", play "jugar", "jugada", pass "pasar", declare "declarar", exchange "intercambio", game
// "partida".

import { ordinals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("es");

export const common: Texts["common"] = {
  name: "Chef’s Hat",
  skipToContent: "Saltar al contenido",
  nav: {
    label: "Páginas",
    lobby: "Vestíbulo",
    tournaments: "Torneos",
    leaderboard: "Clasificación",
    tutorial: "Aprende a jugar",
  },
  settings: {
    title: "Ajustes",
    language: "Idioma",
    theme: "Tema",
    themes: { system: "Sistema", light: "Claro", dark: "Oscuro" },
    table: {
      title: "En la mesa",
      names: {
        notification: "Avísame cuando me toque",
        tab: "Muestra mi turno en la pestaña del navegador",
        vibration: "Vibra cuando me toque",
        awake: "Mantén la pantalla encendida",
        keys: "Teclas para las cartas, pasar y jugar",
        plans: "Déjame elegir antes de mi turno",
        autoPass: "Pasa por mí cuando no pueda jugar nada",
        moments: "Muestra en grande los momentos especiales",
      },
      hints: {
        notification: "Mientras miras otra cosa. El navegador te lo pregunta antes.",
        tab: "En el título y en el icono.",
        vibration: "En los dispositivos que pueden hacerlo.",
        awake: "Durante una partida.",
        keys: "9 e Intro juegan un 9, p pasa. El signo de interrogación las muestra todas.",
        plans: "Se juega en tu turno, si todavía está permitido.",
        autoPass: "Tras una pausa como las tuyas, para no revelar nada a los demás. No en los estudios.",
        moments: "Food Fight, Dinner is Served, el intercambio, la carta dorada, una última carta.",
      },
      notAllowed:
        "Tu navegador no permite las notificaciones de esta página. Puedes cambiarlo en los ajustes del navegador.",
    },
    names: {
      key: "Tu clave de identidad",
      hint: "Otras personas pueden elegir tu nombre, pero no tienen tu clave: las clasificaciones os muestran por separado. La clave se crea cuando entras por primera vez en una partida. Para ser la misma persona en otro dispositivo, escríbela allí; no se la digas a nadie más.",
      notAKey: "Una clave tiene 64 cifras de 0 a 9 y de a a f.",
      use: "Usar esta clave",
      replaces:
        "Este dispositivo jugará entonces como la persona de la clave nueva. Copia antes la anterior si quieres volver a ser esa persona.",
    },
    measuring: "Midiendo la conexión…",
    lag: (ms) => `El servidor responde en ${ms}\u00a0ms.`,
    fullScreen: "Pantalla completa",
    fullScreenOff: "Salir de la pantalla completa",
    forget: "Olvidar todo en este dispositivo",
    forgetSure:
      "Se borran de este dispositivo tus asientos, tus plazas en torneos, las salas y los torneos que has creado, tu nombre con su clave y tus ajustes. No podrás recuperarlos.",
    forgetDo: "Olvidar todo",
  },
  kinds: {
    agent: "agente",
    human: "persona",
    robot: "robot",
    model: "modelo",
    builtIn: "agente integrado",
    open: "libre",
  },
  characters: {
    trained: "con experiencia",
    greedy: "con prisa",
    random: "a la aventura",
    random_unmasked: "a ciegas",
    monte_carlo: "con calma",
  },
  roles: { chef: "Chef", sousChef: "Sous-Chef", cook: "Cocinero", waiter: "Camarero", dishwasher: "Lavaplatos" },
  faces: [
    "trufa",
    "gamba",
    "anchoa",
    "alcachofa",
    "chile",
    "albahaca",
    "aceituna",
    "pimiento",
    "champiñón",
    "tomate",
    "mozzarella",
  ],
  cards: (count) => plural(count, { one: "# carta", other: "# cartas" }),
  points: (count) => plural(count, { one: "# punto", other: "# puntos" }),
  place: ordinals("es", { other: ".º" }),
  seat: (seat) => `Asiento ${seat + 1}`,
  /** Headings of tables. */
  columns: {
    place: "Puesto",
    name: "Nombre",
    games: "Partidas",
    points: "Puntos",
    places: "Puestos",
    rating: "Valoración",
  },
  close: "Cerrar",
  cancel: "Cancelar",
  changedMeanwhile: (before, now) => `No se ha hecho nada: mientras tanto, ${now} ha ocupado el lugar de ${before}.`,
  copy: "Copiar",
  copied: "Copiado",
  loading: "Cargando…",
  showMore: "Mostrar más",
  toLobby: "Ir al vestíbulo",
  pageNotLoaded: "No se ha podido cargar esta página. Comprueba tu conexión y vuelve a cargarla.",
  outdated: {
    text: "El servidor se ha actualizado y esta página es la versión anterior. Tus sitios y partidas se conservan al cargar la nueva.",
    load: "Cargar la nueva versión",
  },
  pageBroken: {
    title: "Se ha producido un error en esta página",
    text: "Es un error de la propia página, no de tu conexión. Tu sitio y todo lo que hay en la mesa se conservan.",
    reload: "Volver a cargar",
  },
  notFound: {
    title: "Página no encontrada",
    text: "En esta dirección no hay nada.",
  },
};
