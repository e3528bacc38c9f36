// Italian texts of tutorial/.

import type { Texts } from "../texts";

export const tutorial: Texts["tutorial"] = {
  you: "Rosa",
  step: (step, all) => `${step} / ${all}`,
  next: "Avanti",
  watch: "Giocano gli altri…",
  play: "Gioca subito una partita",
  notThis: "Buona idea per dopo, ma questa lezione chiede altro.",
  lessons: {
    cards:
      "Quattro giocatori, uno scopo: restare per primi senza carte. Il numero di una carta è il suo valore. Più è basso, più la carta è rara: c’è un solo 1, ci sono due 2, e così via fino a undici 11, e due jolly.",
    opening:
      "Hai l’11 d’oro: apri tu lo Shift, e in questo turno devi giocarlo. Le carte dello stesso valore possono andare insieme: scegli tutti e due gli 11, poi Gioca.",
    beating:
      "Gustav ha giocato due 9. Per batterli serve un valore più raro, cioè un numero più basso, e almeno altrettante carte. I tuoi due 8 vanno bene.",
    leading:
      "Tutti gli altri hanno passato, quindi questa pizza è finita. Chi ha giocato per ultimo inizia la prossima: il piatto è vuoto e va bene qualsiasi giocata. Liberati del tuo unico 10.",
    passing:
      "Il 2 di Gustav è molto raro e non hai nulla di più raro, quindi devi passare. Sei fuori finché questa pizza non è finita, e torni per la prossima.",
    again: "Una pizza nuova. Gustav inizia con due 6. Battili con i tuoi due 5.",
    joker:
      "Rolf gioca due 4. Hai un 3 e un jolly. Un jolly prende il valore delle carte con cui è giocato, quindi insieme sono due 3. Giocali e resti senza carte prima di tutti!",
    points:
      "Il primo posto vale 5 punti, il secondo 3, il terzo 1. I posti sono anche i ruoli del prossimo Shift: Chef, Sous-Chef, Cameriere, Lavapiatti. Si gioca finché qualcuno ha 15 punti.",
    special:
      "Ogni tanto qualcuno riceve tutti e due i jolly e può dichiararlo: Dinner is Served, e non si scambiano carte; oppure, da Lavapiatti, Food Fight, e tutti i ruoli si invertono.",
    exchange:
      "Prima di uno Shift si scambiano carte: le due più rare del Lavapiatti vanno allo Chef, che ne restituisce due qualsiasi; Cameriere e Sous-Chef fanno lo stesso con una. Sei lo Chef. Di quale carta puoi fare a meno?",
    exchangeAgain: "E un’altra. Vedrai che cosa ricevi quando tutti avranno scelto.",
    end: "È tutto. Le carte che puoi giocare sono chiare, e la pagina ti dice perché le altre non si possono giocare. Ora siediti a un tavolo vero.",
  },
};
