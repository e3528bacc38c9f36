// German texts of tutorial/.

import type { Texts } from "../texts";

export const tutorial: Texts["tutorial"] = {
  you: "Rosa",
  step: (step, all) => `${step} / ${all}`,
  next: "Weiter",
  watch: "Die anderen spielen…",
  play: "Jetzt eine Partie spielen",
  notThis: "Eine gute Idee für später, aber in dieser Lektion geht es um etwas anderes.",
  lessons: {
    cards:
      "Vier Spieler, ein Ziel: zuerst keine Karten mehr haben. Die Zahl einer Karte ist ihr Wert. Je kleiner, desto seltener: Es gibt eine 1, zwei 2er und so weiter bis zu elf 11ern, und zwei Joker.",
    opening:
      "Du hast die goldene 11, also eröffnest du den Shift, und in diesem Zug musst du sie spielen. Karten eines Wertes dürfen zusammen gespielt werden: Wähle beide 11er, dann „Spielen“.",
    beating:
      "Gustav hat zwei 9er gespielt. Um sie zu schlagen, brauchst du einen selteneren Wert, also eine kleinere Zahl, und mindestens so viele Karten. Deine zwei 8er reichen.",
    leading:
      "Alle anderen haben gepasst, also ist diese Pizza fertig. Wer zuletzt gespielt hat, beginnt die nächste: Das Brett ist leer, und alles ist erlaubt. Werde deine einzelne 10 los.",
    passing:
      "Gustavs 2 ist sehr selten, und du hast nichts Selteneres, also musst du passen. Du bist draußen, bis diese Pizza fertig ist, und bei der nächsten wieder dabei.",
    again: "Eine neue Pizza. Gustav beginnt mit zwei 6ern. Schlage sie mit deinen zwei 5ern.",
    joker:
      "Rolf spielt zwei 4er. Du hast eine 3 und einen Joker. Ein Joker nimmt den Wert der Karten an, mit denen er gespielt wird; zusammen sind sie also zwei 3er. Spiele beide, und du hast als Erste keine Karten mehr!",
    points:
      "Platz 1 bringt 5 Punkte, Platz 2 bringt 3, Platz 3 bringt 1. Die Plätze sind auch die Rollen im nächsten Shift: Chef, Sous-Chef, Kellner, Tellerwäscher. Die Partie geht weiter, bis jemand 15 Punkte hat.",
    special:
      "Ab und zu bekommt jemand beide Joker und darf etwas ansagen: Dinner is Served, dann werden keine Karten getauscht; oder, als Tellerwäscher, Food Fight, dann werden alle Rollen umgekehrt.",
    exchange:
      "Vor einem Shift werden Karten getauscht: Die zwei seltensten des Tellerwäschers gehen an den Chef, der zwei beliebige zurückgibt; Kellner und Sous-Chef tun dasselbe mit einer. Du bist Chef. Auf welche Karte kannst du verzichten?",
    exchangeAgain: "Und noch eine. Was du bekommst, siehst du, wenn alle gewählt haben.",
    end: "Das ist alles. Die Karten, die du spielen kannst, sind hell, und bei den anderen sagt dir die Seite, warum sie nicht gehen. Setz dich jetzt an einen richtigen Tisch.",
  },
};
