// Spanish texts of tutorial/.

import type { Texts } from "../texts";

export const tutorial: Texts["tutorial"] = {
  you: "Rosa",
  step: (step, all) => `${step} / ${all}`,
  next: "Continuar",
  watch: "Juegan los demás…",
  play: "Jugar ya una partida",
  notThis: "Buena idea para después, pero esta lección pide otra cosa.",
  lessons: {
    cards:
      "Cuatro jugadores, un objetivo: quedarse sin cartas antes que nadie. El número de una carta es su valor. Cuanto más bajo, más rara: hay un 1, hay dos 2, y así hasta once 11, y dos comodines.",
    opening:
      "Tienes el 11 dorado, así que abres el Shift, y en este turno tienes que jugarlo. Las cartas de un mismo valor pueden ir juntas: elige los dos 11 y luego «Jugar».",
    beating:
      "Gustav ha jugado dos 9. Para superarlos necesitas un valor más raro, es decir, un número más bajo, y al menos tantas cartas. Tus dos 8 sirven.",
    leading:
      "Todos los demás han pasado, así que esta pizza está lista. Quien jugó por última vez empieza la próxima: el tablero está vacío y vale cualquier jugada. Deshazte de tu único 10.",
    passing:
      "El 2 de Gustav es muy raro y no tienes nada más raro, así que tienes que pasar. Quedas fuera hasta que esta pizza esté lista y vuelves para la próxima.",
    again: "Una pizza nueva. Gustav empieza con dos 6. Supéralos con tus dos 5.",
    joker:
      "Rolf juega dos 4. Tienes un 3 y un comodín. Un comodín toma el valor de las cartas con las que se juega, así que juntos son dos 3. ¡Juega los dos y te quedas sin cartas antes que nadie!",
    points:
      "El primer puesto da 5 puntos, el segundo 3, el tercero 1. Los puestos son también los roles del próximo Shift: Chef, Sous-Chef, Camarero, Lavaplatos. La partida sigue hasta que alguien tiene 15 puntos.",
    special:
      "De vez en cuando alguien recibe los dos comodines y puede declararlo: Dinner is Served, y no se intercambian cartas; o, como Lavaplatos, Food Fight, y todos los roles se invierten.",
    exchange:
      "Antes de un Shift se intercambian cartas: las dos más raras del Lavaplatos van al Chef, que devuelve dos cualesquiera; el Camarero y el Sous-Chef hacen lo mismo con una. Eres el Chef. ¿De qué carta puedes prescindir?",
    exchangeAgain: "Y otra más. Verás lo que recibes cuando todos hayan elegido.",
    end: "Eso es todo. Las cartas que puedes jugar se ven claras, y la página te dice por qué las otras no se pueden jugar. Ahora siéntate a una mesa de verdad.",
  },
};
