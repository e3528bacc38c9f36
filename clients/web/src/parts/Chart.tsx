// Lines of seats over a game: points by Shift, or what decisions were worth. Each line ends at the
// number of its seat, so that colour is never the only difference. A picture: what it says stands in
// words beside it.

import css from "./Chart.module.css";
import { SeatNumber } from "./SeatNumber";

/** The drawing's own units, which are stretched to the space there is. */
const WIDTH = 1000;
const HEIGHT = 200;
/** The distance between the numbers at the ends of two lines, where there is room for all: a part of the height. */
const APART = 0.28;

/** A line: its points from left to right; a new part begins where it is interrupted. */
export interface ChartLine {
  readonly seat: number;
  readonly parts: readonly (readonly (readonly [x: number, y: number])[])[];
}

interface ChartProps {
  /** What is drawn, in a sentence. */
  label: string;
  lines: readonly ChartLine[];
  /** The right end; the left one is 0. */
  width: number;
  /** The value at the top; that at the bottom is 0. */
  top: number;
  /** Where vertical lines are. */
  marks?: readonly number[];
  /** The moment that is shown elsewhere on the page. */
  at?: number;
  /** The reader pointed at a moment. */
  onGo?: (x: number) => void;
}

export function Chart({ label, lines, width, top, marks = [], at, onGo }: ChartProps) {
  const x = (value: number) => (WIDTH * value) / Math.max(width, 1);
  const y = (value: number) => HEIGHT * (1 - Math.min(1, Math.max(0, value / Math.max(top, 1))));
  return (
    <div class={css.chart} data-part="chart">
      <div class={`${css.scale} small soft number`} aria-hidden="true">
        <span>{top}</span>
        <span>0</span>
      </div>
      {/* biome-ignore lint/a11y/useKeyWithClickEvents: by keyboard, the slider and the list below lead to the same moments */}
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={label}
        data-pointed={onGo && ""}
        onClick={(event) => {
          const box = event.currentTarget.getBoundingClientRect();
          onGo?.(((event.clientX - box.left) / Math.max(box.width, 1)) * width);
        }}
      >
        <path class={css.rule} d={`M0 0H${WIDTH}M0 ${HEIGHT}H${WIDTH}`} />
        {marks.map((mark) => (
          <path key={mark} class={css.rule} d={`M${x(mark)} 0V${HEIGHT}`} />
        ))}
        {lines.map(({ seat, parts }) => (
          <path
            key={seat}
            class={css.line}
            style={{ stroke: `var(--seat-${seat})` }}
            // With `h0` the line of a single point is a dot.
            d={parts
              .map((part) => `M${part.map(([px, py]) => `${x(px).toFixed(1)} ${y(py).toFixed(1)}`).join("L")}h0`)
              .join("")}
          />
        ))}
        {at !== undefined && <path class={css.at} d={`M${x(at)} 0V${HEIGHT}`} />}
      </svg>
      <div class={css.ends} aria-hidden="true">
        {ends(lines, y).map(({ seat, height }) => (
          <span key={seat} style={{ top: percent(height) }}>
            <SeatNumber seat={seat} />
          </span>
        ))}
      </div>
    </div>
  );
}

function percent(part: number): string {
  return `${(100 * part).toFixed(1)}%`;
}

/** Where the numbers of the seats stand: beside the ends of their lines, but not on each other. */
function ends(lines: readonly ChartLine[], y: (value: number) => number): { seat: number; height: number }[] {
  const wished = lines
    .flatMap(({ seat, parts }) => {
      const last = parts.at(-1)?.at(-1);
      return last ? [{ seat, height: y(last[1]) / HEIGHT }] : [];
    })
    .sort((a, b) => a.height - b.height || a.seat - b.seat);
  const apart = Math.min(APART, 1 / Math.max(1, wished.length - 1));
  // Down from the top, then up from the bottom where that went too far.
  let above = -apart;
  for (const end of wished) above = end.height = Math.max(end.height, above + apart);
  let below = 1 + apart;
  for (const end of wished.toReversed()) below = end.height = Math.min(end.height, below - apart);
  return wished;
}
