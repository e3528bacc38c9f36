// Italian texts that several parts of the page use: the frame, kinds of participants, words of the
// game.

import { ordinals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("it");

export const common: Texts["common"] = {
  name: "Chef’s Hat",
  skipToContent: "Vai al contenuto",
  nav: {
    label: "Pagine",
    lobby: "Sala",
    tournaments: "Tornei",
    leaderboard: "Classifica",
    tutorial: "Impara a giocare",
  },
  settings: {
    title: "Impostazioni",
    language: "Lingua",
    theme: "Tema",
    themes: { system: "Sistema", light: "Chiaro", dark: "Scuro" },
    table: {
      title: "Al tavolo",
      names: {
        notification: "Avvisami quando tocca a me",
        tab: "Mostra il mio turno nella scheda del browser",
        vibration: "Vibra quando tocca a me",
        awake: "Tieni acceso lo schermo",
        keys: "Tasti per le carte, per passare e per giocare",
        plans: "Fammi scegliere prima del mio turno",
        autoPass: "Passa per me quando non posso giocare nulla",
        moments: "Mostra in grande i momenti speciali",
      },
      hints: {
        notification: "Mentre guardi altro. Prima te lo chiede il browser.",
        tab: "Nel titolo e nell’icona.",
        vibration: "Sui dispositivi che possono farlo.",
        awake: "Durante una partita.",
        keys: "9 e Invio giocano un 9, p passa. Il punto interrogativo li mostra tutti.",
        plans: "Viene giocata al tuo turno, se è ancora permessa.",
        autoPass: "Dopo una pausa come le tue, così agli altri non rivela nulla. Non negli studi.",
        moments: "Food Fight, Dinner is Served, lo scambio, la carta d’oro, un’ultima carta.",
      },
      notAllowed: "Il browser non permette le notifiche di questa pagina. Puoi cambiarlo nelle sue impostazioni.",
    },
    names: {
      key: "La tua chiave d’identità",
      hint: "Altri possono scegliere il tuo nome, ma non hanno la tua chiave: le classifiche vi elencano separati. La chiave si crea quando entri per la prima volta in una partita. Per essere la stessa persona su un altro dispositivo, inseriscila lì; non dirla a nessun altro.",
      notAKey: "Una chiave ha 64 cifre da 0 a 9 e da a a f.",
      use: "Usa questa chiave",
      replaces:
        "Questo dispositivo giocherà allora come la persona della nuova chiave. Copia prima quella di adesso se vuoi tornare a essere quella persona.",
    },
    measuring: "Misura della connessione…",
    lag: (ms) => `Il server risponde dopo ${ms}\u00a0ms.`,
    fullScreen: "Schermo intero",
    fullScreenOff: "Esci da schermo intero",
    forget: "Dimentica tutto su questo dispositivo",
    forgetSure:
      "Da questo dispositivo vengono eliminati i tuoi posti, le iscrizioni ai tornei, le stanze e i tornei creati, il nome con la sua chiave e le impostazioni. Non potrai recuperarli.",
    forgetDo: "Dimentica tutto",
  },
  kinds: {
    agent: "agente",
    human: "persona",
    robot: "robot",
    model: "modello",
    builtIn: "agente integrato",
    open: "libero",
  },
  characters: {
    trained: "con esperienza",
    greedy: "di fretta",
    random: "a caso",
    random_unmasked: "alla cieca",
    monte_carlo: "con calma",
  },
  roles: { chef: "Chef", sousChef: "Sous-Chef", cook: "Cuoco", waiter: "Cameriere", dishwasher: "Lavapiatti" },
  faces: [
    "tartufo",
    "gambero",
    "acciuga",
    "carciofo",
    "peperoncino",
    "basilico",
    "oliva",
    "peperone",
    "fungo",
    "pomodoro",
    "mozzarella",
  ],
  cards: (count) => plural(count, { one: "# carta", other: "# carte" }),
  points: (count) => plural(count, { one: "# punto", other: "# punti" }),
  place: ordinals("it", { other: "º" }),
  seat: (seat) => `Posto ${seat + 1}`,
  /** Headings of tables. */
  columns: {
    place: "Posizione",
    name: "Nome",
    games: "Partite",
    points: "Punti",
    places: "Piazzamenti",
    rating: "Valutazione",
  },
  close: "Chiudi",
  cancel: "Annulla",
  changedMeanwhile: (before, now) => `Non è stato fatto nulla: nel frattempo ${now} ha preso il posto di ${before}.`,
  copy: "Copia",
  copied: "Copiato",
  loading: "Caricamento…",
  showMore: "Mostra altro",
  toLobby: "Vai alla sala",
  pageNotLoaded: "Non è stato possibile caricare questa pagina. Controlla la connessione e ricarica.",
  outdated: {
    text: "Il server è stato aggiornato e questa pagina è la versione precedente. I tuoi posti e le tue partite restano quando carichi quella nuova.",
    load: "Carica la nuova versione",
  },
  pageBroken: {
    title: "In questa pagina si è verificato un errore",
    text: "È un errore della pagina stessa, non della connessione. Il tuo posto e tutto ciò che è sul tavolo restano.",
    reload: "Ricarica",
  },
  notFound: { title: "Questa pagina non esiste", text: "A questo indirizzo non c’è nulla." },
};
