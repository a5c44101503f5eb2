//! A token lets a client do what it is for.

use std::net::TcpStream;
use std::path::Path;

use serde_json::json;
use tandem_session::controller::NoPersistence;
use tandem_session::operator::Role;

use crate::doors::{Client, NEVER, with_controller};
use crate::support::machine;

#[test]
fn a_token_lets_a_client_do_what_it_is_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let (all, operate, watch) = (file("all"), file("operate"), file("watch"));
    let token = |path: &Path| std::fs::read_to_string(path).unwrap().trim().to_string();
    with_controller(
        &machine("mill-3axis.toml"),
        Box::new(NoPersistence),
        |options| {
            options.listen.tcp = Some("127.0.0.1:0".parse().unwrap());
            options.listen.token_file = Some(all.clone());
            options.listen.role_token_files = vec![
                (operate.clone(), Role::Operate),
                (watch.clone(), Role::Watch),
            ];
        },
        |socket, address| {
            let come = |token: &str| {
                let stream = TcpStream::connect(address.unwrap()).unwrap();
                stream.set_read_timeout(Some(NEVER)).unwrap();
                let mut client = Client::over(stream);
                client.say("token", json!({ "token": token }));
                let greeting = client.hear();
                (client, greeting)
            };
            let (_, refused) = come("0123456789abcdef0123456789abcdef");
            assert!(
                refused["error"]["why"]
                    .as_str()
                    .unwrap()
                    .contains("another token")
            );
            Client::in_control(socket).ok("lease", json!({ "how": "release" }));

            let (mut watcher, greeting) = come(&token(&watch));
            assert_eq!(greeting["tandem"]["role"], "watch");
            watcher.ok("status", json!({}));
            watcher.ok("emergency-stop", json!({}));
            watcher.until_state("emergency-stop");
            for (request, with) in [
                ("lease", json!({ "how": "take" })),
                ("lease", json!({ "how": "take-over" })),
                ("reset", json!({})),
                ("mdi", json!({ "line": "G0 X1" })),
                ("set-offset", json!({ "x_mm": 1.0 })),
            ] {
                let why = watcher.why(request, with);
                assert!(why.contains("this client may watch"), "{request}: {why}");
            }

            let (mut operator, greeting) = come(&token(&operate));
            assert_eq!(greeting["tandem"]["role"], "operate");
            operator.ok("lease", json!({ "how": "take" }));
            operator.ok("reset", json!({}));
            for (request, with) in [
                ("set-offset", json!({ "x_mm": 1.0 })),
                ("set-parameter", json!({ "number": 500, "value": 1.0 })),
                ("touch-off", json!({ "x_mm": 1.0 })),
            ] {
                let why = operator.why(request, with);
                assert!(why.contains("only be asked by who may set-up"), "{why}");
            }
            operator.ok("lease", json!({ "how": "release" }));

            let (mut owner, greeting) = come(&token(&all));
            assert_eq!(greeting["tandem"]["role"], "set-up");
            owner.ok("lease", json!({ "how": "take" }));
            owner.ok("set-offset", json!({ "x_mm": 1.0 }));
            // It may step down, is greeted once more, and never comes up again.
            owner.ok("role", json!({ "as": "operate" }));
            assert_eq!(owner.hear()["tandem"]["role"], "operate");
            assert!(
                owner
                    .why("set-offset", json!({ "x_mm": 2.0 }))
                    .contains("may operate")
            );
            owner.ok("role", json!({ "as": "watch" }));
            assert_eq!(
                owner.wait(|told| told.get("tandem").is_some())["tandem"]["role"],
                "watch"
            );
            assert!(
                owner
                    .why("role", json!({ "as": "operate" }))
                    .contains("never widened")
            );
            assert!(
                owner
                    .why("mdi", json!({ "line": "G0 X1" }))
                    .contains("may watch")
            );
        },
    );
}
