// German texts of the rules in short.

import type { Texts } from "../texts";

export const rules: Texts["rules"] = {
  title: "Die Regeln in Kürze",
  complete: "Das sind die Standardregeln. Ein Raum kann das Deck, die Punkte und einige Optionen ändern.",
  each: {
    goal: {
      title: "Das Ziel",
      text: "Werde deine Karten zuerst los. In einem Shift werden alle Karten ausgeteilt und gespielt, bis nur noch ein Spieler Karten hat; für die Plätze gibt es Punkte.",
    },
    cards: {
      title: "Die Karten",
      text: "Die Zahl auf einer Zutat ist ihr Wert. Je kleiner die Zahl, desto seltener und stärker ist die Karte: Die 1 gibt es einmal, die 2 zweimal und so weiter bis zur 11, die es elfmal gibt.",
    },
    golden: {
      title: "Die goldene Karte",
      text: "Eine Karte mit dem höchsten Wert ist golden. Wer sie hat, eröffnet den Shift. Sonst ist sie eine gewöhnliche Karte ihres Wertes.",
    },
    jokers: {
      title: "Joker",
      text: "Ein Joker, der mit Zutaten gespielt wird, zählt als eine weitere Karte ihres Wertes. Ein einzelner Joker ist das Schwächste, was man spielen kann: Er kann nur eine Pizza beginnen.",
    },
    opening: {
      title: "Der erste Zug eines Shifts",
      text: "Wer die goldene Karte hat, beginnt und muss sie spielen, allein oder mit weiteren Karten ihres Wertes und Jokern. Passen ist nicht erlaubt.",
    },
    leading: {
      title: "Eine Pizza beginnen",
      text: "Das Brett ist leer: Spiele beliebig viele Karten eines Wertes, mit oder ohne Joker, oder einen einzelnen Joker. Du darfst auch passen.",
    },
    beating: {
      title: "Das Brett schlagen",
      text: "Spiele Karten eines Wertes. Der Wert muss kleiner sein als der auf dem Brett, und du brauchst mindestens so viele Karten. Mehr sind erlaubt, und Joker zählen mit.",
    },
    passing: {
      title: "Passen",
      text: "Du darfst passen, auch wenn du spielen könntest. Dann bist du draußen, bis diese Pizza fertig ist, und bei der nächsten wieder dabei.",
    },
    pizzaDone: {
      title: "Wann eine Pizza fertig ist",
      text: "Eine Pizza ist fertig, wenn alle anderen gepasst haben. Das Brett wird geleert, und wer zuletzt gespielt hat, beginnt die nächste Pizza; wer keine Karten mehr hat, gibt das an den nächsten Spieler links ab, der noch welche hat.",
    },
    finishing: {
      title: "Fertig werden",
      text: "Wer seine letzte Karte spielt, bekommt den besten Platz, der noch frei ist. Der Shift endet, wenn nur noch ein Spieler Karten hat.",
    },
    roles: {
      title: "Rollen",
      text: "Dein Platz im letzten Shift ist deine Rolle in diesem: Chef, Sous-Chef, Kellner, Tellerwäscher; bei anderer Spielerzahl gibt es dazwischen Köche.",
    },
    special: {
      title: "Sonderaktionen",
      text: "Wer beim Austeilen beide Joker bekommt, darf vor dem Tausch etwas ansagen oder schweigen. Beim Tellerwäscher ist es ein Food Fight: Alle Rollen werden umgekehrt. Bei allen anderen ist es Dinner is Served: Es werden keine Karten getauscht.",
    },
    exchange: {
      title: "Der Tausch",
      text: "Der Tellerwäscher gibt dem Chef seine zwei seltensten Zutaten und bekommt zwei beliebige Karten zurück. Kellner und Sous-Chef tun dasselbe mit einer Karte. Alle wählen, was sie geben, bevor sie sehen, was sie bekommen.",
    },
    points: {
      title: "Punkte",
      text: "Bei vier Spielern bringen die Plätze eines Shifts 5, 3, 1 und 0 Punkte.",
    },
    end: {
      title: "Das Ende der Partie",
      text: "Die Partie endet nach dem Shift, in dem jemand 15 Punkte erreicht. Die meisten Punkte gewinnen; bei Gleichstand entscheidet der bessere Platz im letzten Shift.",
    },
  },
  help: {
    title: "Was kann ich tun?",
    all: "Alle Regeln in Kürze",
    keys: "Tasten",
    keysOff: "Die Tasten sind in den Einstellungen ausgeschaltet.",
    key: {
      faces: (last) => (last > 9 ? "1 … 9, 0" : `1 … ${last}`),
      pick: (last) =>
        last > 10
          ? "wählen Karten mit Wert 1 bis 10; bei höheren Werten steht ein Buchstabe unter den Karten. Nochmals: eine Karte mehr."
          : "wählen Karten eines Wertes. Nochmals: eine Karte mehr.",
      addJoker: "nimmt zu den gewählten Karten einen Joker dazu oder die Joker wieder weg",
      jokers: "wählt einen einzelnen Joker",
      play: "spielt die gewählten Karten oder gibt sie ab",
      pass: "passt",
      special: "sagt die Sonderaktion an oder nicht",
      back: "legt alles zurück; die Rücktaste legt eine Karte zurück",
      express: "springt zu den Reaktionen",
      help: "öffnet diese Hilfe",
    },
  },
};
