//! Page of a live watch, drawn by the script of replays.

use maud::{DOCTYPE, PreEscaped, html};

use super::{POLICY, STYLE, metadata, replay, theme_choice};

/// Rules of the log of notices.
const LOG_STYLE: &str = "#log{list-style:none;padding:0;max-height:16rem;overflow:auto;\
                         font-variant-numeric:tabular-nums}\
                         #verdict{font-size:1.2rem;font-weight:700}";

/// Returns the page of a live watch. It reads positions and notices from the WebSocket `live` of its server.
#[must_use]
pub fn live_page() -> String {
    let (script, hash) = replay::packed(embedded!("TAUTLINE_ASSETS", "live.js"));
    let policy = format!("{POLICY}; {} {hash}; connect-src 'self'", replay::script_source());
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                (metadata(&policy))
                title { "Live watch" }
                style { (PreEscaped(STYLE)) (PreEscaped(replay::STYLE)) (PreEscaped(LOG_STYLE)) }
            }
            body {
                header {
                    (theme_choice())
                    p.kind { "Live watch" }
                    h1 { "tautline watch" }
                    p #verdict role="status" { "UNDECIDED: the page is not connected" }
                }
                main {
                    section {
                        h2 { "Positions" }
                        p.about { "The newest positions of the last seconds. A vehicle that is not drawn is stale." }
                        div.replay data-label="the watch" data-start="later" { script type="application/json" {} }
                    }
                    section { h2 { "Notices" } ul #log {} }
                }
                (replay::script())
                script { (PreEscaped(script)) }
            }
        }
    };
    page.into_string()
}

#[cfg(test)]
mod tests {
    use super::live_page;

    #[test]
    fn the_page_admits_its_two_scripts_and_its_own_server_only() {
        let page = live_page();
        assert_eq!(page.matches("'sha256-").count() + page.matches("&#39;sha256-").count(), 2);
        assert!(page.contains("connect-src 'self'") || page.contains("connect-src &#39;self&#39;"));
        assert!(!page.contains("http://") && !page.contains("https://"));
    }
}
