// All German texts.

import type { Texts } from "../en";
import { attend } from "./attend";
import { common } from "./common";
import { faults } from "./faults";
import { lobby } from "./lobby";
import { organise } from "./organise";
import { people } from "./people";
import { replay } from "./replay";
import { rules } from "./rules";
import { studies } from "./studies";
import { table } from "./table";
import { tournaments } from "./tournaments";
import { tutorial } from "./tutorial";
import { wizard } from "./wizard";

export const de: Texts = {
  attend,
  common,
  faults,
  lobby,
  organise,
  people,
  replay,
  rules,
  studies,
  table,
  tournaments,
  tutorial,
  wizard,
};
