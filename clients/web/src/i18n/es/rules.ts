// Spanish texts of the rules in short.

import type { Texts } from "../texts";

export const rules: Texts["rules"] = {
  title: "Las reglas en breve",
  complete: "Estas son las reglas predeterminadas. Una sala puede cambiar la baraja, los puntos y algunas opciones.",
  each: {
    goal: {
      title: "El objetivo",
      text: "Quedarte sin cartas antes que nadie. En un Shift se reparten todas las cartas y se juega hasta que solo queda un jugador con cartas; los puestos dan puntos.",
    },
    cards: {
      title: "Las cartas",
      text: "El número de un ingrediente es su valor. Cuanto más bajo, más rara y fuerte es la carta: hay un solo 1, hay dos 2, y así hasta once 11.",
    },
    golden: {
      title: "La carta dorada",
      text: "Una carta del valor más alto es dorada. Quien la tiene abre el Shift. Por lo demás es una carta normal de su valor.",
    },
    jokers: {
      title: "Los comodines",
      text: "Un comodín jugado con ingredientes cuenta como una carta más de su valor. Un comodín solo es la jugada más débil que hay: únicamente puede empezar una pizza.",
    },
    opening: {
      title: "El primer turno de un Shift",
      text: "Empieza quien tiene la carta dorada: debe jugarla, sola o con más cartas de su valor y comodines, y no puede pasar.",
    },
    leading: {
      title: "Empezar una pizza",
      text: "El tablero está vacío: juega cuantas cartas quieras de un mismo valor, con o sin comodines, o un comodín solo. También puedes pasar.",
    },
    beating: {
      title: "Superar el tablero",
      text: "Juega cartas de un mismo valor. Tiene que ser más bajo que el del tablero, y necesitas al menos tantas cartas. Más también vale, y los comodines cuentan.",
    },
    passing: {
      title: "Pasar",
      text: "Puedes pasar aunque pudieras jugar. Quedas fuera hasta que esta pizza esté lista y vuelves para la próxima.",
    },
    pizzaDone: {
      title: "Cuándo está lista una pizza",
      text: "Una pizza está lista cuando todos los demás han pasado. El tablero se vacía y quien jugó por última vez empieza la próxima; si ya no tiene cartas, empieza el siguiente jugador a su izquierda que tenga.",
    },
    finishing: {
      title: "Terminar",
      text: "Quien juega su última carta ocupa el mejor puesto que quede libre. El Shift termina cuando solo un jugador tiene cartas.",
    },
    roles: {
      title: "Los roles",
      text: "Tu puesto en el último Shift es tu rol en este: Chef, Sous-Chef, Camarero, Lavaplatos; si no son cuatro jugadores, puede haber Cocineros en medio.",
    },
    special: {
      title: "Las acciones especiales",
      text: "Quien recibe los dos comodines en el reparto puede declararlo antes del intercambio, o callar. Para el Lavaplatos es un Food Fight: todos los roles se invierten. Para los demás es Dinner is Served: no se intercambian cartas.",
    },
    exchange: {
      title: "El intercambio",
      text: "El Lavaplatos da al Chef sus dos ingredientes más raros y recibe dos cartas cualesquiera. El Camarero y el Sous-Chef hacen lo mismo con una carta. Se elige qué dar antes de ver qué se recibe.",
    },
    points: {
      title: "Los puntos",
      text: "Con cuatro jugadores, los puestos de un Shift dan 5, 3, 1 y 0 puntos.",
    },
    end: {
      title: "El final de la partida",
      text: "La partida termina después del Shift en el que alguien llega a 15 puntos. Gana quien tiene más; si hay empate, decide el mejor puesto en el último Shift.",
    },
  },
  help: {
    title: "¿Qué puedo hacer?",
    all: "Todas las reglas en breve",
    keys: "Teclas",
    keysOff: "Las teclas están desactivadas en los ajustes.",
    key: {
      faces: (last) => (last > 9 ? "1 … 9, 0" : `1 … ${last}`),
      pick: (last) =>
        last > 10
          ? "eligen cartas de valor 1 a 10; los valores más altos tienen una letra debajo de las cartas. Otra vez: una carta más."
          : "eligen cartas de un valor. Otra vez: una carta más.",
      addJoker: "añade un comodín a las cartas elegidas, o quita los comodines",
      jokers: "elige un comodín solo",
      play: "juega o da las cartas elegidas",
      pass: "pasa",
      special: "declara la acción especial, o no",
      back: "devuelve todas las cartas; Retroceso devuelve una",
      express: "va a las reacciones",
      help: "abre esta ayuda",
    },
  },
};
