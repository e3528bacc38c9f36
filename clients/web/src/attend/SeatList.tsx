// The seats of a table with real cards: who, cards left, role, points, passed, hand known or not.

import { TableStage, type TableState } from "../gen/chefshat/v1/table_service_pb";
import { t } from "../i18n";
import { KindBadge } from "../parts/KindBadge";
import { SeatNumber } from "../parts/SeatNumber";
import { isTaken, type TableState as Table } from "../table/model/state";
import { distinctName, roleWord } from "../table/words";
import css from "./Attend.module.css";

export function SeatList({ state, table }: { state: TableState; table: Table }) {
  const words = t().attend.seats;
  const begun = state.observation !== undefined;
  return (
    <section class={`${css.part} sheet`} aria-labelledby="seats-title">
      <h2 id="seats-title">{t().table.room.seats}</h2>
      <ul class={css.seats}>
        {table.seats.map((seat) => {
          const known = state.seats[seat.seat]?.handKnown ?? false;
          const role = roleWord(seat.role);
          const next = begun && state.seat === seat.seat && state.stage !== TableStage.OVER;
          const toPlay = next && state.stage === TableStage.TURN;
          return (
            <li key={seat.seat} class={`${css.seat} ${next ? css.next : ""}`} data-part="attend-seat">
              <SeatNumber seat={seat.seat} />
              <div class={css.who}>
                <div class={css.name}>
                  <h3>{isTaken(seat) ? distinctName(table, seat.seat) : t().table.freeSeat}</h3>
                  {role && <span class="soft"> {role}</span>}
                </div>
                <p class={css.badges}>
                  {isTaken(seat) && <KindBadge kind={seat.kind} builtIn={seat.builtIn} name={seat.name} />}
                  <span class="soft">{seat.atTable ? t().table.physical.atTable : words.remote}</span>
                  {isTaken(seat) && !seat.connected && !seat.builtIn && <strong>{t().table.presence.away}</strong>}
                </p>
              </div>
              {begun && (
                <div class={css.state}>
                  <p class="number">
                    <strong>{t().common.cards(seat.cardsLeft)}</strong> · {t().common.points(seat.points)}
                  </p>
                  <p class={css.badges}>
                    {seat.place > 0 && <span class={css.chip}>{t().common.place(seat.place)}</span>}
                    {seat.passed && <span class={css.chip}>{words.passed}</span>}
                    {toPlay && <span class={`${css.chip} ${css.chipNext}`}>{words.next}</span>}
                    {seat.cardsLeft > 0 && (
                      <span class="soft">
                        <span aria-hidden="true">{known ? "◉" : "○"}</span>{" "}
                        {known ? words.handKnown : words.handUnknown}
                      </span>
                    )}
                  </p>
                </div>
              )}
            </li>
          );
        })}
      </ul>
    </section>
  );
}
