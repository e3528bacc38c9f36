// The controls of a replay: steps, play and pause, a slider, speed, perspective.

import { t } from "../i18n";
import { SelectField } from "../parts/Field";
import { Icon } from "../parts/Icon";
import toolsCss from "../table/view/Tools.module.css";
import { distinctName } from "../table/words";
import { type Film, type Frame, marked } from "./frames";
import type { Perspective } from "./perspective";
import replayCss from "./Replay.module.css";

/** Playback speeds; at 1, MOMENT_MS per moment. */
export const SPEEDS = [0.5, 1, 2, 4, 8] as const;
export type Speed = (typeof SPEEDS)[number];

interface ControlsProps {
  film: Film;
  frame: Frame;
  at: number;
  playing: boolean;
  speed: Speed;
  perspective: Perspective;
  onGo: (at: number) => void;
  onPlaying: (playing: boolean) => void;
  onSpeed: (speed: Speed) => void;
  onPerspective: (perspective: Perspective) => void;
}

export function Controls({
  film,
  frame,
  at,
  playing,
  speed,
  perspective,
  onGo,
  onPlaying,
  onSpeed,
  onPerspective,
}: ControlsProps) {
  const words = t().replay;
  const last = film.length - 1;
  const shift = film.shifts.findLast((start) => start.frame <= at);
  return (
    <section class={replayCss.replay} data-part="replay" aria-label={words.title}>
      <div class={`${replayCss.bar} sheet`} data-part="replay-bar">
        <div class={replayCss.buttons}>
          <Step label={words.first} path="M18 5v14l-9-7ZM6 5v14" disabled={at === 0} onClick={() => onGo(0)} />
          <Step label={words.before} path="M15 5v14l-9-7Z" disabled={at === 0} onClick={() => onGo(at - 1)} />
          <Step
            label={playing ? words.pause : words.play}
            path={playing ? "M8 5v14M16 5v14" : "M7 4v16l13-8Z"}
            main
            onClick={() => onPlaying(!playing)}
          />
          <Step label={words.after} path="M9 5v14l9-7Z" disabled={at === last} onClick={() => onGo(at + 1)} />
          <Step label={words.last} path="M6 5v14l9-7ZM18 5v14" disabled={at === last} onClick={() => onGo(last)} />
        </div>
        <label class={replayCss.slider} data-part="replay-slider">
          <span class="visually-hidden">{words.moment}</span>
          <input
            type="range"
            min={0}
            max={last}
            value={at}
            aria-valuetext={words.decisionOf(frame.decisions, film.decisions)}
            onInput={(event) => onGo(Number(event.currentTarget.value))}
          />
          <span class={replayCss.marks} aria-hidden="true">
            {marked(film).map((start) => (
              <i
                key={start.shift}
                style={{ insetInlineStart: `${((start.frame / Math.max(1, last)) * 100).toFixed(2)}%` }}
              />
            ))}
          </span>
          <span class="small soft number">{words.decisionOf(frame.decisions, film.decisions)}</span>
        </label>
      </div>
      <div class={`${replayCss.choices} sheet`}>
        <SelectField
          label={words.shift}
          value={String(shift?.frame ?? 0)}
          options={film.shifts.map((start) => ({
            value: String(start.frame),
            label: t().table.result.shift(start.shift),
          }))}
          onPick={(picked) => onGo(Number(picked))}
        />
        <SelectField
          label={words.speed}
          value={String(speed)}
          options={SPEEDS.map((value) => ({ value: String(value), label: `× ${value}` }))}
          onPick={(picked) => onSpeed(SPEEDS.find((value) => String(value) === picked) ?? 1)}
        />
        <SelectField
          label={words.perspective}
          value={String(perspective)}
          options={[
            { value: "all", label: film.handsKnown ? words.allHands : words.noHands },
            ...frame.table.seats.map(({ seat }) => ({
              value: String(seat),
              label: words.as(distinctName(frame.table, seat)),
            })),
            { value: "none", label: words.asSpectator },
          ]}
          onPick={(picked) => onPerspective(picked === "all" || picked === "none" ? picked : Number(picked))}
        />
      </div>
    </section>
  );
}

interface StepProps {
  label: string;
  path: string;
  main?: boolean;
  disabled?: boolean;
  onClick: () => void;
}

/** A button that stays focusable when disabled. */
function Step({ label, path, main = false, disabled = false, onClick }: StepProps) {
  return (
    <button
      type="button"
      class={`${toolsCss.tool} ${main ? replayCss.main : ""}`}
      data-part="tool"
      aria-label={label}
      title={label}
      aria-disabled={disabled}
      onClick={() => !disabled && onClick()}
    >
      <Icon filled>
        <path d={path} />
      </Icon>
    </button>
  );
}
