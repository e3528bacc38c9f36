// The form of a language's texts: that of the English ones.

import type * as en from "./en";

export type Texts = typeof en;
