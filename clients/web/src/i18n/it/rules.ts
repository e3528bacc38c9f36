// Italian texts of the rules in short.

import type { Texts } from "../texts";

export const rules: Texts["rules"] = {
  title: "Le regole in breve",
  complete: "Queste sono le regole predefinite. Una stanza può cambiare il mazzo, i punti e alcune opzioni.",
  each: {
    goal: {
      title: "Lo scopo",
      text: "Restare senza carte per primi. In uno Shift si distribuiscono tutte le carte e si gioca finché uno solo ne ha ancora; i posti valgono punti.",
    },
    cards: {
      title: "Le carte",
      text: "Il numero di un ingrediente è il suo valore. Più è basso, più la carta è rara e forte: c’è un solo 1, ci sono due 2 e così via fino a undici 11.",
    },
    golden: {
      title: "La carta d’oro",
      text: "Una carta del valore più alto è d’oro. Chi ce l’ha apre lo Shift. Per il resto è una carta come le altre del suo valore.",
    },
    jokers: {
      title: "I jolly",
      text: "Un jolly giocato con degli ingredienti conta come un’altra carta del loro valore. Da solo è la giocata più debole che ci sia: può soltanto iniziare una pizza.",
    },
    opening: {
      title: "Il primo turno di uno Shift",
      text: "Inizia chi ha la carta d’oro: deve giocarla, da sola o con altre carte dello stesso valore e jolly, e non può passare.",
    },
    leading: {
      title: "Iniziare una pizza",
      text: "Il piatto è vuoto: gioca quante carte vuoi di un solo valore, con o senza jolly, oppure un jolly da solo. Puoi anche passare.",
    },
    beating: {
      title: "Battere il piatto",
      text: "Gioca carte di un solo valore, più basso di quello sul piatto, e almeno altrettante. Di più va bene, e i jolly contano.",
    },
    passing: {
      title: "Passare",
      text: "Puoi passare anche se potresti giocare. Sei fuori finché questa pizza non è finita, poi rientri per la prossima.",
    },
    pizzaDone: {
      title: "Quando una pizza è finita",
      text: "Una pizza finisce quando tutti gli altri hanno passato. Il piatto si svuota e chi ha giocato per ultimo inizia la prossima; se non ha più carte, tocca al primo alla sua sinistra che ne ha.",
    },
    finishing: {
      title: "Finire le carte",
      text: "Chi gioca la sua ultima carta prende il miglior posto ancora libero. Lo Shift finisce quando uno solo ha ancora carte.",
    },
    roles: {
      title: "I ruoli",
      text: "Il tuo posto nell’ultimo Shift è il tuo ruolo in questo: Chef, Sous-Chef, Cameriere, Lavapiatti; se non si gioca in quattro ci possono essere dei Cuochi in mezzo.",
    },
    special: {
      title: "Le azioni speciali",
      text: "Chi riceve entrambi i jolly può dichiararlo prima dello scambio, o tacere. Per il Lavapiatti è un Food Fight: tutti i ruoli si invertono. Per gli altri è Dinner is Served: niente scambio.",
    },
    exchange: {
      title: "Lo scambio",
      text: "Il Lavapiatti dà allo Chef i suoi due ingredienti più rari e ne riceve due carte qualsiasi. Cameriere e Sous-Chef fanno lo stesso con una carta. Si sceglie che cosa dare prima di vedere che cosa si riceve.",
    },
    points: {
      title: "I punti",
      text: "In quattro, i posti di uno Shift valgono 5, 3, 1 e 0 punti.",
    },
    end: {
      title: "La fine della partita",
      text: "La partita finisce dopo lo Shift in cui qualcuno arriva a 15 punti. Vince chi ne ha di più; a parità decide il posto migliore nell’ultimo Shift.",
    },
  },
  help: {
    title: "Che cosa posso fare?",
    all: "Tutte le regole in breve",
    keys: "Tasti",
    keysOff: "I tasti sono disattivati nelle impostazioni.",
    key: {
      faces: (last) => (last > 9 ? "1 … 9, 0" : `1 … ${last}`),
      pick: (last) =>
        last > 10
          ? "scelgono le carte di valore da 1 a 10; i valori più alti hanno una lettera sotto le carte. Di nuovo: una carta in più."
          : "scelgono le carte di un valore. Di nuovo: una carta in più.",
      addJoker: "aggiunge un jolly alle carte scelte, o toglie i jolly",
      jokers: "sceglie un jolly da solo",
      play: "gioca o dà le carte scelte",
      pass: "passa",
      special: "dichiara l’azione speciale, oppure no",
      back: "rimette tutto a posto; Backspace rimette una carta",
      express: "va alle espressioni",
      help: "apre questo aiuto",
    },
  },
};
