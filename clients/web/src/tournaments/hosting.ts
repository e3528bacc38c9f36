// Organising a tournament: creating it, changes that this device takes note of, and the secrets that it
// stores. Taking part is in place.ts.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { tournamentApi } from "../api/client";
import { keepSecret } from "../api/secrets";
import { keepTableTicket } from "../attend/ticket";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { TournamentSettingsSchema } from "../gen/chefshat/v1/tournament_pb";
import { pathOf } from "../router";
import { recallObject, remember } from "../store";
import { asPlace, type HeldPlace } from "./place";

/** The secrets of a tournament that this device created. */
export interface HostedTournament {
  joinCode: string;
  ownerToken: string;
  /** Places given to other people, whose links are still to be passed on. */
  links?: HeldPlace[];
}

/** The secrets of a tournament, if this device created it. */
export function hostedTournament(tournamentId: string): HostedTournament | null {
  return recallObject(`organised.${tournamentId}`, ({ joinCode, ownerToken, links }) =>
    typeof joinCode === "string" && typeof ownerToken === "string"
      ? { joinCode, ownerToken, links: Array.isArray(links) ? links.flatMap((one) => asPlace(one) ?? []) : [] }
      : null,
  );
}

function keepHosted(tournamentId: string, hosted: HostedTournament): void {
  remember(`organised.${tournamentId}`, JSON.stringify(hosted));
}

/** The places whose links the organiser has still to pass on. */
export function placeLinks(tournamentId: string): readonly HeldPlace[] {
  return hostedTournament(tournamentId)?.links ?? [];
}

/** Forgets a link that has been passed on. */
export function dismissPlaceLink(tournamentId: string, ticket: string): void {
  keepLinks(tournamentId, (links) => links.filter((held) => held.ticket !== ticket));
}

/** The links to a place lead nowhere any more: somebody else has it, or nobody. */
function dropLinksTo(tournamentId: string, participant: number): void {
  keepLinks(tournamentId, (links) => links.filter((held) => held.participant !== participant));
}

function keepLinks(tournamentId: string, change: (links: HeldPlace[]) => HeldPlace[]): void {
  const hosted = hostedTournament(tournamentId);
  if (hosted) keepHosted(tournamentId, { ...hosted, links: change(hosted.links ?? []) });
}

/** Creates a tournament and stores its secrets; returns its id. */
export async function createTournament(settings: MessageInitShape<typeof TournamentSettingsSchema>): Promise<string> {
  const { tournament, joinCode, ownerToken } = await tournamentApi.createTournament({ settings });
  if (!tournament) throw new Error("the server did not say which tournament it is");
  keepHosted(tournament.tournamentId, { joinCode, ownerToken });
  keepSecret(ownerToken, tournament.settings?.policy);
  return tournament.tournamentId;
}

/** Removes a participant of a tournament that this device created. */
export async function removeParticipant(tournamentId: string, participant: number): Promise<void> {
  await tournamentApi.removeParticipant({ ...ownership(tournamentId), participant });
  dropLinksTo(tournamentId, participant);
}

/** Gives the place of a participant to a built-in agent. */
export async function replaceByAgent(tournamentId: string, participant: number, builtInAgent: string): Promise<void> {
  const request = { ...ownership(tournamentId), participant, builtInAgent };
  await tournamentApi.replaceParticipant(request);
  dropLinksTo(tournamentId, participant);
}

/**
 * Gives the place of a participant to somebody else. The link for that person stays on this device
 * until it is dismissed: nobody else has the ticket.
 */
export async function replaceByPerson(tournamentId: string, participant: number, name: string): Promise<void> {
  const request = {
    ...ownership(tournamentId),
    participant,
    name: name.trim(),
    kind: ParticipantKind.HUMAN,
  };
  const { ticket } = await tournamentApi.replaceParticipant(request);
  dropLinksTo(tournamentId, participant);
  keepLinks(tournamentId, (links) => [...links, { ticket, participant, name: name.trim() }]);
}

/** Adds a participant at a physical table to a tournament that this device created. */
export async function addAtTable(tournamentId: string, name: string, kind: ParticipantKind): Promise<void> {
  const request = { ...ownership(tournamentId), name: name.trim(), kind };
  await tournamentApi.addTableParticipant(request);
}

/** Stores the ticket of the table of a physical game in progress on this device; returns its room. */
export async function takeTable(tournamentId: string, game: number): Promise<string> {
  const { roomId, tableTicket } = await tournamentApi.getPhysicalTable({ ...ownership(tournamentId), game });
  keepTableTicket(roomId, tableTicket);
  return roomId;
}

/** The invitation address of a tournament. */
export function invitationTo(tournamentId: string, code: string): string {
  return `${location.origin}${pathOf({ page: "tournament", tournamentId })}?code=${encodeURIComponent(code)}`;
}

/** The secrets of calls about a tournament that this device created. */
export function ownership(tournamentId: string) {
  return { tournamentId, ownerToken: hostedTournament(tournamentId)?.ownerToken ?? "" };
}
