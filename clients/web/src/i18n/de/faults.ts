// What can go wrong in a call, in German.

import type { Texts } from "../texts";
import { time } from "./time";

export const faults: Texts["faults"] = {
  notReached: "Der Server antwortet nicht. Vielleicht startet er gerade neu; versuche es gleich noch einmal.",
  unknown: "Etwas ist schiefgegangen.",
  tooMuch: "Das war zu viel auf einmal.",
  again: (ms: number) => `Versuche es in ${time(ms)} noch einmal.`,
  pageBroken:
    "Auf dieser Seite ist ein Fehler aufgetreten. Lade sie neu: Dein Platz und alles am Tisch bleiben erhalten.",
  byReason: {
    TOKEN_MISSING:
      "Dieser Server ist nur für Eingeladene offen. Bitte die Person, die ihn betreibt, um einen Link mit Token und öffne ihn hier.",
    TOKEN_UNKNOWN:
      "Der Server kennt das Token deines Links nicht. Prüfe, ob du den vollständigen Link geöffnet hast, oder bitte die Person, die den Server betreibt, um einen neuen.",
    TOKEN_EXPIRED:
      "Das Token deines Links ist abgelaufen. Bitte die Person, die den Server betreibt, um einen neuen Link.",
    ROLE_TOO_LOW: "Dein Link erlaubt das nicht. Bitte die Person, die den Server betreibt, um einen passenden.",
    OUT_OF_SCOPE: "Dein Link gilt für einen anderen Raum oder ein anderes Turnier.",
    ROOM_UNKNOWN: "Diesen Raum gibt es nicht mehr, oder er ist privat.",
    ROOM_FULL: "Alle Plätze dieses Raums sind besetzt.",
    SEAT_TAKEN: "Diesen Platz hat gerade jemand anders genommen.",
    NO_SUCH_SEAT: "Diesen Platz gibt es in diesem Raum nicht.",
    KIND_NOT_ADMITTED: "Die freien Plätze sind für andere Arten von Teilnehmern reserviert.",
    CLIENT_HAS_SEAT: "Du hast in diesem Raum schon einen Platz, und alle dürfen nur einen nehmen.",
    GAME_STARTED: "Die Partie hat schon begonnen. Du kannst zuschauen.",
    GAME_OVER: "Die Partie ist zu Ende.",
    SEAT_ASSIGNED: "Dieser Platz gehört zur Studie. Zurückziehen kannst du dich auf der Seite der Studie.",
    GAME_NOT_STARTED: "Die Partie hat noch nicht begonnen.",
    GAME_NOT_PHYSICAL: "Diese Partie wird nicht mit echten Karten gespielt.",
    NO_PHYSICAL_TABLES:
      "Dieses Turnier hat keine Partien mit echten Karten; daher kann niemand an einem Tisch hinzugefügt werden.",
    NO_SUCH_OPTION: "Diese Antwort gibt es zu der Frage nicht, oder sie ist schon beantwortet.",
    TOO_MANY_QUESTIONS: "Zu viele Fragen sind offen. Beantworte zuerst diese.",
    TOO_MANY_SEATINGS: "Plätze dieses Raums wurden zu oft genommen und aufgegeben. Bitte um einen neuen Raum.",
    TOO_MANY_HELD_REPORTS:
      "Warte: Zuerst muss eine Frage beantwortet werden. Von der Antwort hängen die wartenden Meldungen ab.",
    NOT_CORRECTABLE: "Diese Meldung kann nicht mehr berichtigt werden.",
    JOIN_CODE_WRONG:
      "Dieser Code gehört zu keinem Raum oder Turnier, dem du beitreten kannst. Prüfe ihn; vielleicht ist die Partie auch schon zu Ende.",
    TICKET_UNKNOWN: "Dieser Platz wurde aufgegeben. Tritt mit dem Code noch einmal bei.",
    SPECTATORS_NOT_ADMITTED: "In diesem Raum darf niemand zuschauen.",
    TOO_MANY_SPECTATORS: "Dieser Raum hat schon so viele Zuschauer, wie er erlaubt.",
    DECISION_CLOSED: "Diese Entscheidung ist nicht mehr offen.",
    CHAT_OFF: "In diesem Raum kann man nicht schreiben; es gibt fertige Sätze.",
    HINTS_OFF: "In diesem Raum gibt es keine Tipps.",
    TOO_MANY_HINTS: "Du hast für diese Entscheidung schon alle Tipps bekommen.",
    TOO_MANY_EXPRESSIONS: "Zu viele Reaktionen auf einmal. Warte einen Moment.",
    TOO_MANY_ROOMS:
      "Es können gerade keine Räume mehr erstellt werden. Schließe einen, den du nicht mehr brauchst, oder warte, bis einer endet.",
    TOO_MANY_CALLS: "Der Server bekommt zu viele Anfragen aus deinem Netz oder mit deinem Link.",
    TOO_MANY_CALLS_AT_ONCE: "Der Server bekommt zu viele Anfragen aus deinem Netz oder mit deinem Link.",
    TOO_MANY_UNREAD_ANSWERS: "Der Server bekommt zu viele Anfragen aus deinem Netz oder mit deinem Link.",
    TOO_MANY_LARGE_MESSAGES: "Der Server bekommt zu viele Anfragen aus deinem Netz oder mit deinem Link.",
    TOO_MANY_WAITING_CALLS:
      "Der Server bekommt zu viele Anfragen aus deinem Netz oder mit deinem Link. Lade die Seite neu.",
    TOO_MANY_STREAMS:
      "Aus deinem Netz oder mit deinem Link sind zu viele Seiten und Agenten verbunden. Schließe einige davon.",
    TOO_MANY_FOLLOWERS: "Gerade verfolgen zu viele Leute Turniere.",
    TOO_MANY_WRONG_CODES: "Es wurden zu viele falsche Codes eingegeben. Prüfe den Code.",
    READER_TOO_SLOW: "Deine Verbindung ist zu langsam, um das zu laden. Versuche es mit einer besseren.",
    DISK_NEARLY_FULL:
      "Die Festplatte des Servers ist fast voll: Es kann nichts Neues beginnen. Die Person, die ihn betreibt, muss Platz schaffen. Laufende Partien gehen weiter.",
    STORE_FAILED:
      "Der Server kann keine Partien speichern und hält an. Deine bisherigen Entscheidungen sind gespeichert; die Partien gehen weiter, wenn er wieder da ist.",
    OWNER_UNREACHABLE:
      "Der zuständige Server ist nicht erreichbar, oder ein anderer übernimmt gerade. Versuche es gleich noch einmal.",
    NODE_NOT_REACHED:
      "Die anderen Server erreichen diesen nicht; deshalb nimmt er nichts Neues an. Versuche es gleich noch einmal; wenn es wieder fehlschlägt, sag der Person Bescheid, die ihn betreibt.",
    ROOM_GONE: "Dieser Raum wurde gerade geschlossen, oder der Server hält an. Versuche es gleich noch einmal.",
    INTERNAL:
      "Der Server konnte das nicht ausführen. Versuche es noch einmal; wenn es wieder fehlschlägt, sag der Person Bescheid, die ihn betreibt.",
    SHUTTING_DOWN: "Der Server wird gerade abgeschaltet. Die Partien gehen weiter, wenn er wieder da ist.",
    GAME_UNKNOWN: "Der Server hat keine Aufzeichnung dieser Partie, oder sie ist privat.",
    RECORD_UNREADABLE:
      "Die Aufzeichnung dieser Partie ist beschädigt. Bitte informiere den Betreiber des Servers. Andere Partien sind nicht betroffen.",
    GAME_RUNNING: "Die Partie läuft noch. Ihre Aufzeichnung gibt es, wenn sie zu Ende ist.",
    SERIES_OPEN:
      "Andere Partien mit denselben Karten laufen noch. Die Aufzeichnung gibt es, wenn die Runde zu Ende ist.",
    TOURNAMENT_UNKNOWN: "Dieses Turnier gibt es nicht, oder es ist privat.",
    TOURNAMENT_STARTED: "Das Turnier hat schon begonnen.",
    TOO_FEW_PARTICIPANTS: "Vor dem Start müssen sich mindestens zwei Teilnehmer anmelden.",
    TOO_MANY_TOURNAMENTS:
      "Es können gerade keine Turniere mehr erstellt werden. Schließe eines, das du nicht mehr brauchst, oder warte, bis eines zu Ende ist.",
    OWNER_TOKEN_WRONG: "Das geht nur auf dem Gerät, auf dem es erstellt wurde.",
    NOT_STATELESS: "Personen können sich nicht anmelden: Dieselben Karten werden mehrmals gespielt.",
    TOURNAMENT_FULL: "Das Turnier ist voll.",
    NAME_REFUSED: "Dieser Name ist länger als 64 Zeichen oder enthält unsichtbare Zeichen. Wähle einen anderen.",
    NAME_RESERVED: "So heißen eingebaute Agenten, die Tische auffüllen. Wähle einen anderen Namen.",
    PARTICIPANT_UNKNOWN: "Diesen Teilnehmer gibt es nicht mehr.",
    PARTICIPANT_IS_FILLER: "Dieser Agent füllt die Tische auf und kann nicht gehen. Du kannst ihn ersetzen.",
    REPLACED_TOO_OFTEN: "Dieser Platz wurde schon so oft weitergegeben, wie es möglich ist.",
    TOURNAMENT_OVER: "Das Turnier ist zu Ende.",
    TOURNAMENT_NOT_PLAYING: "Das geht nur, während das Turnier läuft.",
    GAME_NOT_DUE: "Die Partie hat inzwischen begonnen oder ist zu Ende.",
    NOBODY_LEFT: "Alle Teilnehmer dieser Partie sind gegangen. Ersetze zuerst einen von ihnen.",
    NOT_IN_GAME: "Du spielst in dieser Partie nicht mit.",
    POSTPONED_TOO_OFTEN: "Du hast diese Partie schon so oft verschoben, wie es möglich ist. Frage die Turnierleitung.",
    TOO_MANY_CHANGES: "Dieses Turnier wurde zu oft geändert.",
    NAME_TAKEN: "Diesen Namen hat schon jemand anders. Wähle einen anderen.",
    LINK_UNKNOWN:
      "Dieser Link gehört zu keiner Studie auf diesem Server. Prüfen Sie, ob Sie den vollständigen Link geöffnet haben, oder fragen Sie die Person, die ihn Ihnen gegeben hat.",
    PANEL_ID_TAKEN:
      "Mit dieser Kennung nimmt schon jemand teil. Machen Sie in dem Browser weiter, in dem Sie begonnen haben.",
    PANEL_ID_REFUSED:
      "Der Link hat keine gültige Kennung. Öffnen Sie ihn noch einmal von der Seite, die Sie eingeladen hat.",
    SESSION_UNKNOWN: "Die Verbindung zur Studie wurde unterbrochen. Öffnen Sie Ihren Link noch einmal.",
    SESSION_SUPERSEDED:
      "Die Studie wurde in einem anderen Fenster oder auf einem anderen Gerät geöffnet. Sie geht dort weiter.",
    STUDY_FULL: "Alle Plätze dieser Studie sind vergeben. Danke für Ihr Interesse.",
    WRONG_DEVICE: "Diese Studie braucht ein anderes Gerät.",
    STUDY_CLOSED: "Diese Studie ist geschlossen. Danke für Ihr Interesse.",
    STUDY_RUNNING: "Einige sind mitten in dieser Studie. Warte, bis sie fertig sind, oder entferne sie.",
    STUDY_UNKNOWN: "Diese Studie gibt es nicht, oder der Schlüssel gehört nicht zu ihr.",
    TOO_MANY_STUDIES: "Auf diesem Server können keine Studien mehr erstellt werden.",
    TOO_MANY_SESSIONS: "Diese Studie wurde in kurzer Zeit zu oft geöffnet. Versuchen Sie es gleich noch einmal.",
    TOO_MANY_PARTICIPANTS: "Zu dieser Studie können keine Teilnehmer mehr hinzugefügt werden.",
    PARTICIPATION_OVER: "Diese Teilnahme ist zu Ende.",
    ANSWER_REFUSED: "Eine Antwort gehört nicht zu den möglichen. Prüfen Sie Ihre Antworten.",
    TOO_MANY_ANSWERS:
      "Der Server hat keinen Speicher für weitere Antworten. Kürzen Sie Ihre, oder fragen Sie die Person, von der Sie den Link haben.",
    GAME_NOT_OVER: "Die Partie ist noch nicht zu Ende.",
    COUNT_REFUSED: "Gib eine Zahl von 1 bis 1000 ein.",
  },
};
